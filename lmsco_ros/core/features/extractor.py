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

"""From a patch to the series of its feature blocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lmsco_ros.core.backend import Array, Backend
from lmsco_ros.core.config import FeatureConfig
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.features.intensity_channels import intensity_channels
from lmsco_ros.core.fourier.interpolation import interpolate, interpolation_series

__all__ = ['FeatureExtractor', 'hann_window', 'normalize']

Channels = Callable[[np.ndarray], np.ndarray]


class FeatureExtractor:
    """
    Computes the blocks that the configuration names, in its order.

    Parameters
    ----------
    blocks : sequence of FeatureConfig
        What to compute.
    size : int
        Side of the patches in pixels, a multiple of every cell.
    backend : Backend
        Where the series go.

    """

    def __init__(self, blocks: Sequence[FeatureConfig], size: int, backend: Backend) -> None:
        self._backend = backend
        self._groups = [[(_make_channels(group.kind, block.cell), group.weight)
                         for group in block.channels] for block in blocks]
        self._windows, self._kernels = [], []
        xp = backend.namespace
        for block in blocks:
            cells = size // block.cell
            self._windows.append(hann_window(cells)[:, :, None].astype(np.float32))
            self._kernels.append(xp.asarray(interpolation_series(cells)[:, :, None],
                                            dtype=backend.complex, device=backend.device))

    def __call__(self, patch: np.ndarray) -> list[Array]:
        """
        Return the series of all blocks.

        Parameters
        ----------
        patch : ndarray, shape (size, size), float32
            Intensities in the working range.

        Returns
        -------
        list of array, shape (2K_l + 1, K_l + 1, C_l)
            Series of the interpolated, normalized, windowed channels.

        """
        result = []
        for groups, window, kernel in zip(self._groups, self._windows, self._kernels,
                                          strict=True):
            block = np.concatenate([weight * normalize(channels(patch))
                                    for channels, weight in groups], axis=-1)
            block *= window
            result.append(interpolate(self._backend.asarray(block), kernel))
        return result


def normalize(channels: np.ndarray) -> np.ndarray:
    """Return the channels with a mean square of 1; zeros stay zeros."""
    energy = float(np.mean(channels**2))
    return channels / np.float32(np.sqrt(energy)) if energy > 0 else channels


def hann_window(size: int) -> np.ndarray:
    """Return the two-dimensional Hann window without its zero ends, shape (size, size)."""
    axis = np.hanning(size + 2)[1:-1]
    return axis[:, None] * axis[None, :]


def _make_channels(kind: str, cell: int) -> Channels:
    """Return the function that computes a group of channels, shape (N, N, C), of a patch."""
    if kind == 'hog':
        return lambda patch: hog(patch[None], cell)[0]
    return lambda patch: intensity_channels(patch, cell)
