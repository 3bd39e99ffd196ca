# Copyright 2026 lmsco_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What every network has in common: named layers on regular grids of cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
import torch

from lmsco_ros.core.errors import ConfigError

__all__ = ['Backbone', 'Layer']

_Network = TypeVar('_Network', bound='Backbone')


@dataclass(frozen=True)
class Layer:
    """
    An output that features can be taken from.

    Attributes
    ----------
    stride : int
        Side of a cell in pixels of the input.
    channels : int
        Number of channels.
    offset : float
        Pixels by which the middles of the cells lie behind those of squares of side `stride`
        that begin at the corner of the input: cell i looks at i * stride + stride / 2 + offset.

    """

    stride: int
    channels: int
    offset: float = 0.0

    def first_cell(self, margin: int) -> int:
        """
        Return the cell that looks nearest to the middle of the first square inside a margin.

        It looks first_cell * stride + offset - margin pixels past that middle.

        Parameters
        ----------
        margin : int
            Pixels by which the input was extended on every side.

        """
        return round((margin - self.offset) / self.stride)


class Backbone(torch.nn.Module):
    """
    A network whose layers are maps of square cells.

    Attributes
    ----------
    input_channels : int
        Channels that `forward` takes: 1 for intensities in the working range, 3 for flow images
        (u, v, magnitude) of 0..255.
    layers : mapping of str to Layer
        The outputs, from the first to the deepest.
    aliases : mapping of str to str
        The layers that a configuration for any network may call `shallow` and `deep`.
    margin : int
        Pixels by which the input is extended on every side, so that S / stride cells of every
        layer, beginning with `first_cell`, cover the middle S pixels to within half a cell.

    """

    input_channels: ClassVar[int] = 1
    layers: ClassVar[Mapping[str, Layer]] = {}
    aliases: ClassVar[Mapping[str, str]] = {}
    margin: ClassVar[int] = 0

    @classmethod
    def layer_name(cls, name: str) -> str:
        """
        Return the layer that `name`, possibly an alias, stands for.

        Raises
        ------
        ConfigError
            When the network has no such layer; names those that it has.

        """
        resolved = cls.aliases.get(name, name)
        if resolved not in cls.layers:
            raise ConfigError(f'{cls.__name__} has no layer {name!r}; expected one of '
                              f'{", ".join((*cls.aliases, *cls.layers))}')
        return resolved

    @classmethod
    def file_shapes(cls) -> dict[str, tuple[int, ...]]:
        """Return the name and the shape of each array that a file of weights must hold."""
        with torch.device('meta'):
            return {name: tuple(tensor.shape) for name, tensor in cls().state_dict().items()}

    @classmethod
    def own_names(cls, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the arrays of a foreign file under the names of `file_shapes`."""
        return dict(arrays)

    @classmethod
    def from_arrays(cls: type[_Network], arrays: Mapping[str, np.ndarray]) -> _Network:
        """
        Return the network with the given weights, ready to run.

        Parameters
        ----------
        arrays : mapping of str to ndarray, float32
            With the names and shapes of `file_shapes`.

        """
        with torch.device('meta'):
            network = cls()
        state = {name: torch.from_numpy(np.array(array, np.float32))
                 for name, array in cls._state(arrays).items()}
        network.load_state_dict(state, assign=True)
        network.eval().requires_grad_(False)
        # The overload that takes a memory format is missing in the annotations of torch.
        return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @classmethod
    def _state(cls, arrays: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        """Return the state of the module that holds the weights of a file."""
        return arrays

    def forward(self, images: torch.Tensor, layers: Sequence[str]) -> list[torch.Tensor]:
        """
        Return the named layers, computing nothing beyond the deepest of them.

        Parameters
        ----------
        images : tensor, shape (n, input_channels, H, W), float32
            Input, extended by `margin`.
        layers : sequence of str
            Keys of `layers`.

        Returns
        -------
        list of tensor, shape (n, C_l, H_l, W_l)
            One for each name, in the order asked for.

        """
        raise NotImplementedError
