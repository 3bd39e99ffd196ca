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

"""From patches to the series of their feature blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lmsco_ros.core.backend import Array, array_namespace, Backend
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.features.intensity_channels import intensity_channels
from lmsco_ros.core.features.projection import Projection
from lmsco_ros.core.fourier.interpolation import interpolate, interpolation_series
from lmsco_ros.core.sections import ChannelConfig, FeatureConfig, NETWORK_KINDS

__all__ = ['FeatureExtractor', 'hann_window', 'normalize']

NetworkPass = Callable[[np.ndarray], Mapping[tuple[str, int], Array]]


@dataclass(frozen=True)
class _Block:
    """What a block is made of, and what is done to it."""

    config: FeatureConfig
    projection: Projection | None
    window: Array
    kernel: Array


class FeatureExtractor:
    """
    Computes the blocks that the configuration names, in its order.

    Parameters
    ----------
    config : TrackerConfig
        Names the blocks.
    networks : mapping of str to Backbone
        By the kind of channels they show, as `load_networks` returns them.
    size : int
        Side of the patches in pixels, a multiple of every cell.
    backend : Backend
        Where the series go.

    """

    def __init__(self, config: TrackerConfig, networks: Mapping[str, object], size: int,
                 backend: Backend) -> None:
        self._backend = backend
        self._blocks = [_make_block(block, size, backend) for block in config.features]
        self._passes = {kind: _make_pass(config, kind, networks[kind], size, backend)
                        for kind in NETWORK_KINDS if kind in networks}

    def __call__(self, patches: np.ndarray, flow: np.ndarray | None = None) -> list[Array]:
        """
        Return the series of all blocks.

        Parameters
        ----------
        patches : ndarray, shape (n, size, size), float32
            Intensities in the working range.
        flow : ndarray, shape (n, size, size, 3), float32, optional
            Flow images of the same regions. Without motion its channels are zero, which leaves
            them out of score and training.

        Returns
        -------
        list of array, shape (2K_l + 1, K_l + 1, n, C_l)
            Series of the interpolated, normalized, windowed channels.

        """
        inputs = {'appearance': patches, 'motion': flow}
        maps = {kind: None if inputs[kind] is None else run(inputs[kind])
                for kind, run in self._passes.items()}
        return [self._series(block, patches, maps) for block in self._blocks]

    def _series(self, block: _Block, patches: np.ndarray, maps: Mapping[str, Mapping | None]
                ) -> Array:
        """Return the series of one block."""
        groups = [group.weight * normalize(self._channels(group, block.config.cell, patches, maps))
                  for group in block.config.channels]
        xp = array_namespace(groups[0])
        channels = groups[0] if len(groups) == 1 else xp.concat(groups, axis=-1)
        if block.projection is not None:
            channels = normalize(block.projection(channels))
        return interpolate(xp.permute_dims(channels, (1, 2, 0, 3)) * block.window, block.kernel)

    def _channels(self, group: ChannelConfig, cell: int, patches: np.ndarray,
                  maps: Mapping[str, Mapping | None]) -> Array:
        """Return a group of channels, shape (n, N, N, C)."""
        if group.kind in NETWORK_KINDS:
            found = maps[group.kind]
            if found is None:
                return self._silence(group, cell, patches)
            return self._backend.asarray(found[group.layer, cell])
        if group.kind == 'hog':
            return self._backend.asarray(hog(patches, cell))
        return self._backend.asarray(
            np.stack([intensity_channels(patch, cell) for patch in patches]))

    def _silence(self, group: ChannelConfig, cell: int, patches: np.ndarray) -> Array:
        """Return the channels of a network that has nothing to look at."""
        cells = patches.shape[1] // cell
        count = self._passes[group.kind].channels(group.layer)
        return self._backend.asarray(
            np.zeros((len(patches), cells, cells, count), np.float32))


def _requests(config: TrackerConfig, kind: str) -> list[tuple[str, int]]:
    """Return layer and cell of every group of a kind."""
    return [(group.layer, block.cell) for block in config.features
            for group in block.channels if group.kind == kind]


def _make_pass(config: TrackerConfig, kind: str, network: object, size: int,
               backend: Backend) -> NetworkPass:
    """Return the pass through the network of a kind that serves all blocks."""
    from lmsco_ros.core.features.network_channels import NetworkChannels

    return NetworkChannels(network, kind, _requests(config, kind), size, backend)


def _make_block(config: FeatureConfig, size: int, backend: Backend) -> _Block:
    """Return a block with what its number of cells asks for."""
    cells = size // config.cell
    kernel = backend.namespace.asarray(interpolation_series(cells)[:, :, None, None],
                                       dtype=backend.complex, device=backend.device)
    window = backend.asarray(hann_window(cells)[:, :, None, None])
    projection = Projection(config.projection, backend) if config.projection else None
    return _Block(config, projection, window, kernel)


def normalize(channels: Array) -> Array:
    """Return the channels (n, ..., C) of each sample with a mean square of 1; zeros stay."""
    xp = array_namespace(channels)
    energy = xp.mean(channels**2, axis=tuple(range(1, channels.ndim)), keepdims=True)
    return channels * xp.where(energy > 0, 1 / xp.sqrt(xp.where(energy > 0, energy, 1.0)), 0.0)


def hann_window(size: int) -> np.ndarray:
    """Return the two-dimensional Hann window without its zero ends, shape (size, size)."""
    axis = np.hanning(size + 2)[1:-1]
    return axis[:, None] * axis[None, :]
