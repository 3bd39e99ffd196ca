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

"""Layers of a network as feature channels (paper, section III-A)."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

import numpy as np
import torch

from lmsco_ros.core.backend import Array, Backend
from lmsco_ros.core.errors import ConfigError
from lmsco_ros.core.networks.backbone import Backbone

__all__ = ['NetworkChannels']

_INPUT_CHANNELS = {'appearance': 1, 'motion': 3}


class NetworkChannels:
    """
    All the maps that the blocks need of one network, from a single pass.

    Parameters
    ----------
    network : Backbone
        Appearance or motion network, ready to run.
    kind : {'appearance', 'motion'}
        What the network is to show.
    requests : iterable of tuple (str, int)
        Layer and side of the cells in pixels; a multiple of the layer's own.
    size : int
        Side of the patches.
    backend : Backend
        Where the network runs and the channels go.

    Raises
    ------
    ConfigError
        When the network is of the other kind or lacks a layer, or a cell does not consist of
        whole cells of the layer.

    """

    def __init__(self, network: Backbone, kind: str, requests: Iterable[tuple[str, int]],
                 size: int, backend: Backend) -> None:
        _check_kind(network, kind)
        self._requests = {(name, cell): network.layer_name(name) for name, cell in requests}
        self._layers = tuple(dict.fromkeys(self._requests.values()))
        for (_, cell), layer in self._requests.items():
            _check_cell(network, layer, cell)
        self._backend = backend
        self._device = torch.device(backend.device)
        self._network = network.to(self._device)
        self._size = size

    @property
    def whom(self) -> Hashable:
        """The same for all of these that give the same channels of the same patches."""
        return (id(self._network), self._size, *self._requests)

    def channels(self, layer: str) -> int:
        """Return the number of channels of a layer."""
        return self._network.layers[self._network.layer_name(layer)].channels

    def together(self, several: Sequence[np.ndarray]) -> list[dict[tuple[str, int], Array]]:
        """Return, for each of several patches as `__call__` takes them, what that returns."""
        if len(several) == 1:
            return [self(several[0])]
        maps = self(np.concatenate(several))
        ends = np.cumsum([len(patches) for patches in several])
        return [{request: channels[end - len(patches):end] for request, channels in maps.items()}
                for patches, end in zip(several, ends, strict=True)]

    @torch.inference_mode()
    def __call__(self, patches: np.ndarray) -> dict[tuple[str, int], Array]:
        """
        Return the channels of every request, under the request.

        Parameters
        ----------
        patches : ndarray, shape (n, size, size) or (n, size, size, 3), float32
            Intensities in the working range, or flow images.

        Returns
        -------
        dict of array, shape (n, size // cell, size // cell, C_l)

        """
        images = torch.from_numpy(patches).to(self._device)
        images = images[:, None] if images.ndim == 3 else images.permute(0, 3, 1, 2)
        if self._network.margin:
            margin = (self._network.margin,) * 4
            images = torch.nn.functional.pad(images, margin, mode='replicate')
        maps = dict(zip(self._layers, self._network(images, self._layers), strict=True))
        return {(name, cell): self._cells(maps[layer], layer, cell)
                for (name, cell), layer in self._requests.items()}

    def _cells(self, maps: torch.Tensor, layer: str, cell: int) -> Array:
        """Return what a map shows of the patch itself, averaged over cells, channels last."""
        found = self._network.layers[layer]
        first = found.first_cell(self._network.margin)
        inside = slice(first, first + self._size // cell * cell // found.stride)
        rows = maps[:, :, inside, inside].permute(0, 2, 3, 1)
        channels = _average(rows, cell // found.stride).contiguous()
        return channels.numpy() if self._device.type == 'cpu' else channels


def _check_kind(network: Backbone, kind: str) -> None:
    """Refuse a network that looks at something else."""
    expected = _INPUT_CHANNELS[kind]
    if network.input_channels != expected:
        raise ConfigError(
            f'NetworkConfig.{kind}_backbone names a {type(network).__name__}, which takes '
            f'{network.input_channels} channels; expected a network of {expected}: '
            + ('intensities' if kind == 'appearance' else 'flow images'))


def _check_cell(network: Backbone, layer: str, cell: int) -> None:
    """Refuse cells that would cut those of the layer."""
    stride = network.layers[layer].stride
    if cell % stride:
        raise ConfigError(f'FeatureConfig.cell is {cell}, but layer {layer} of '
                          f'{type(network).__name__} has cells of {stride} pixels; '
                          f'expected a multiple of {stride}')


def _average(maps: torch.Tensor, side: int) -> torch.Tensor:
    """Return the means of squares of `side` by `side` cells, shape (n, H, W, C)."""
    if side == 1:
        return maps
    parts = [maps[:, row::side, column::side] for row in range(side) for column in range(side)]
    total = parts[0] + parts[1]
    for part in parts[2:]:
        total += part
    return total.div_(side**2)
