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

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lmsco_ros.core.backend import Array, array_namespace, Backend
from lmsco_ros.core.config import ChannelConfig, FeatureConfig, NETWORK_KINDS, TrackerConfig
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.features.intensity_channels import intensity_channels
from lmsco_ros.core.features.optical_flow import FLOW_CHANNELS, flow_channels
from lmsco_ros.core.features.projection import Projection
from lmsco_ros.core.fourier.interpolation import interpolate, interpolation_series
from lmsco_ros.core.networks.together import Ask, Asking, at_once
from lmsco_ros.core.weights.loading import Networks

if TYPE_CHECKING:
    from lmsco_ros.core.features.network_channels import NetworkChannels

__all__ = ['FeatureExtractor', 'compress', 'hann_window', 'normalize']

_LEAST_ENERGY = 1e-6

Maps = Mapping[tuple[str, int], Array]
"""Channels by layer, if they are of a network, and side of the cells."""


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
    networks : Networks
        As `load_networks` returns them for the configuration.
    size : int
        Side of the patches in pixels, a multiple of every cell.
    backend : Backend
        Where the series go.

    """

    def __init__(self, config: TrackerConfig, networks: Networks, size: int,
                 backend: Backend) -> None:
        self._backend = backend
        self._blocks = [_make_block(block, size, backend) for block in config.features]
        self._passes = _make_passes(config, networks, size, backend)
        self._flow_requests = _requests(config, 'flow')

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
        return at_once(self.ask(patches, flow))

    def ask(self, patches: np.ndarray,
            flow: np.ndarray | None = None) -> Asking[list[Array]]:
        """Return the series as `__call__` does, and ask for the passes of the networks."""
        inputs = {'appearance': patches, 'motion': flow}
        maps = {}
        for kind, run in self._passes.items():
            if (given := inputs[kind]) is not None:
                maps[kind] = yield Ask(run.whom, run.together, given)
        if flow is not None:
            maps['flow'] = {(layer, cell): flow_channels(flow, cell)
                            for layer, cell in self._flow_requests}
        return [self._series(block, patches, maps) for block in self._blocks]

    def _series(self, block: _Block, patches: np.ndarray, maps: Mapping[str, Maps]
                ) -> Array:
        """Return the series of one block."""
        groups = [self._group(group, block.config.cell, patches, maps)
                  for group in block.config.channels]
        xp = array_namespace(groups[0])
        channels = groups[0] if len(groups) == 1 else xp.concat(groups, axis=-1)
        if block.projection is not None:
            channels = normalize(block.projection(channels))
        return interpolate(xp.permute_dims(channels, (1, 2, 0, 3)) * block.window, block.kernel)

    def _group(self, group: ChannelConfig, cell: int, patches: np.ndarray,
               maps: Mapping[str, Maps]) -> Array:
        """Return a normalized group of channels, shape (n, N, N, C)."""
        channels = self._channels(group, cell, patches, maps)
        if group.power < 1:
            channels = compress(channels, group.power)
        return normalize(channels, group.weight)

    def _channels(self, group: ChannelConfig, cell: int, patches: np.ndarray,
                  maps: Mapping[str, Maps]) -> Array:
        """Return a group of channels, shape (n, N, N, C)."""
        if group.kind in (*NETWORK_KINDS, 'flow'):
            if group.kind not in maps:
                return self._silence(group, cell, patches)
            return self._backend.asarray(maps[group.kind][group.layer, cell])
        if group.kind == 'hog':
            return self._backend.asarray(hog(patches, cell))
        return self._backend.asarray(
            np.stack([intensity_channels(patch, cell) for patch in patches]))

    def _silence(self, group: ChannelConfig, cell: int, patches: np.ndarray) -> Array:
        """Return the channels of something that has nothing to look at."""
        cells = patches.shape[1] // cell
        count = (FLOW_CHANNELS if group.kind == 'flow'
                 else self._passes[group.kind].channels(group.layer))
        return self._backend.asarray(
            np.zeros((len(patches), cells, cells, count), np.float32))


def _requests(config: TrackerConfig, kind: str) -> list[tuple[str, int]]:
    """Return layer and cell of every group of a kind."""
    return [(group.layer, block.cell) for block in config.features
            for group in block.channels if group.kind == kind]


def _make_passes(config: TrackerConfig, networks: Networks, size: int,
                 backend: Backend) -> dict[str, NetworkChannels]:
    """Return, for each kind of network channels, the pass that serves all blocks."""
    found = {'appearance': networks.appearance, 'motion': networks.motion}
    used = {kind: network for kind, network in found.items() if network is not None}
    if not used:
        return {}
    from lmsco_ros.core.features.network_channels import NetworkChannels

    return {kind: NetworkChannels(network, kind, _requests(config, kind), size, backend)
            for kind, network in used.items()}


def _make_block(config: FeatureConfig, size: int, backend: Backend) -> _Block:
    """Return a block with what its number of cells asks for."""
    cells = size // config.cell
    kernel = backend.namespace.asarray(interpolation_series(cells)[:, :, None, None],
                                       dtype=backend.complex, device=backend.device)
    window = backend.asarray(hann_window(cells)[:, :, None, None])
    projection = Projection(config.projection, backend) if config.projection else None
    return _Block(config, projection, window, kernel)


def compress(channels: Array, power: float) -> Array:
    """
    Raise the length of each cell's feature vector to a power; zeros stay zeros.

    Parameters
    ----------
    channels : array, shape (n, N, N, C)
        Feature vectors.
    power : float
        Exponent in [0, 1].

    """
    xp = array_namespace(channels)
    energy = xp.vecdot(channels, channels)[..., None] / channels.shape[-1]
    return channels * (energy + _LEAST_ENERGY)**((power - 1) / 2)


def normalize(channels: Array, weight: float = 1.0) -> Array:
    """Return the channels (n, ..., C) of samples, root mean square `weight`; zeros stay."""
    xp = array_namespace(channels)
    rows = xp.reshape(channels, (channels.shape[0], -1))
    energy = xp.vecdot(rows, rows) / rows.shape[1]
    factor = weight / xp.sqrt(xp.where(energy > 0, energy, xp.inf))
    return channels * xp.reshape(factor, (-1,) + (1,) * (channels.ndim - 1))


def hann_window(size: int) -> np.ndarray:
    """Return the two-dimensional Hann window without its zero ends, shape (size, size)."""
    axis = np.hanning(size + 2)[1:-1]
    return axis[:, None] * axis[None, :]
