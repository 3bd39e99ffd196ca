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

"""Histograms of oriented gradients with 31 channels (Felzenszwalb et al., PAMI 2010)."""

from __future__ import annotations

import cv2
import numpy as np

__all__ = ['HOG_CHANNELS', 'hog']

HOG_CHANNELS = 31

_SIGNED = 18
_UNSIGNED = 9
_TRUNCATION = 0.2
_TEXTURE_GAIN = 0.2357


def hog(patches: np.ndarray, cell: int, noise_energy: float = 0.3) -> np.ndarray:
    """
    Return the HOG channels of several patches.

    18 signed and 9 unsigned orientations and 4 texture energies per cell. Each gradient votes
    for its two nearest orientations and its four nearest cells, linearly; each cell is normalized
    by the energy of the four 2x2 blocks around it and truncated.

    Parameters
    ----------
    patches : ndarray, shape (n, H, W), float32
        Intensities; H and W are multiples of `cell`.
    cell : int
        Side of a cell in pixels.
    noise_energy : float
        Added to the energy of a block, in squared intensity times pixels per cell squared:
        blocks with less structure fade to zero.

    Returns
    -------
    ndarray, shape (n, H // cell, W // cell, 31), float32

    """
    histogram = _pool(_orientation_planes(patches), cell)
    unsigned = histogram[:, :_UNSIGNED] + histogram[:, _UNSIGNED:]
    result = np.zeros((len(patches), HOG_CHANNELS, *histogram.shape[2:]), np.float32)
    orientations = np.concatenate([histogram, unsigned], axis=1)
    for i, factor in enumerate(_normalizers(unsigned, noise_energy)):
        truncated = orientations * factor
        np.minimum(truncated, _TRUNCATION, out=truncated)
        result[:, :_SIGNED + _UNSIGNED] += truncated
        result[:, _SIGNED + _UNSIGNED + i] = _TEXTURE_GAIN * truncated[:, :_SIGNED].sum(axis=1)
    result[:, :_SIGNED + _UNSIGNED] *= 0.5
    return np.ascontiguousarray(np.moveaxis(result, 1, -1))


def _orientation_planes(patches: np.ndarray) -> np.ndarray:
    """Return the votes of each pixel, one plane per signed orientation: (n, 18, H, W)."""
    count, height, width = patches.shape
    pixels = height * width
    magnitude, angle = _gradients(patches)
    position = angle * np.float32(_SIGNED / (2 * np.pi))
    lower = np.minimum(position.astype(np.int32), _SIGNED - 1)
    upper_vote = (position - lower) * magnitude
    upper = np.where(lower == _SIGNED - 1, 0, lower + 1)
    base = np.arange(pixels, dtype=np.int32) + (
        np.arange(count, dtype=np.int32) * _SIGNED * pixels)[:, None]
    base = base.reshape(patches.shape)
    planes = np.zeros(count * _SIGNED * pixels, np.float32)
    planes[lower * pixels + base] = magnitude - upper_vote
    planes[upper * pixels + base] = upper_vote
    return planes.reshape(count, _SIGNED, height, width)


def _gradients(patches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return magnitude and direction of the central differences, one-sided at the border."""
    padded = np.pad(patches, ((0, 0), (1, 1), (1, 1)), mode='edge')
    dx = padded[:, 1:-1, 2:] - padded[:, 1:-1, :-2]
    dy = padded[:, 2:, 1:-1] - padded[:, :-2, 1:-1]
    width = patches.shape[-1]
    magnitude, angle = cv2.cartToPolar(dx.reshape(-1, width), dy.reshape(-1, width))
    return magnitude.reshape(patches.shape), angle.reshape(patches.shape)


def _pool(planes: np.ndarray, cell: int) -> np.ndarray:
    """Return the votes per cell, linear in both directions: (n, 18, H // cell, W // cell)."""
    count, bins, height, width = planes.shape
    position = (np.arange(cell) + 0.5) / cell - 0.5
    triangle = np.maximum(0, 1 - np.abs(np.arange(-1, 2)[:, None] - position[None, :]))
    triangle = triangle.astype(np.float32)
    rows = triangle @ planes.reshape(count * bins, height // cell, cell, width)
    rows = _overlap(rows.transpose(1, 2, 0, 3)).transpose(1, 0, 2)
    columns = rows.reshape(-1, cell) @ triangle.T
    columns = columns.reshape(-1, width // cell, 3)
    pooled = np.ascontiguousarray(_overlap(columns.transpose(1, 2, 0)).T)
    return pooled.reshape(count, bins, height // cell, width // cell)


def _overlap(parts: np.ndarray) -> np.ndarray:
    """Add what each cell, along axis 0, gives to its neighbors before and behind (axis 1)."""
    total = parts[:, 1].copy()
    total[1:] += parts[:-1, 2]
    total[:-1] += parts[1:, 0]
    return total


def _normalizers(unsigned: np.ndarray, noise_energy: float) -> list[np.ndarray]:
    """Return, for each of the four blocks around a cell, one over its norm, (n, 1, ...)."""
    energy = (unsigned**2).sum(axis=1, keepdims=True)
    energy = np.pad(energy, ((0, 0), (0, 0), (1, 1), (1, 1)), mode='edge')
    pairs = energy[:, :, 1:] + energy[:, :, :-1]
    blocks = 1 / np.sqrt(pairs[..., 1:] + pairs[..., :-1] + np.float32(noise_energy))
    return [blocks[..., 1:, 1:], blocks[..., :-1, 1:], blocks[..., 1:, :-1], blocks[..., :-1, :-1]]
