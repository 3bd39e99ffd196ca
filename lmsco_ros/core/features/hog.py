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

from functools import lru_cache

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
    histogram = _histogram(patches, cell)
    unsigned = histogram[:_UNSIGNED] + histogram[_UNSIGNED:]
    orientations = np.concatenate([histogram, unsigned]).reshape(_SIGNED + _UNSIGNED, -1)
    result = np.zeros((HOG_CHANNELS, orientations.shape[1]), np.float32)
    energies = result[_SIGNED + _UNSIGNED:]
    for factor, energy in zip(_normalizers(unsigned, noise_energy), energies, strict=True):
        _, truncated = cv2.threshold(
            orientations * factor.ravel(), _TRUNCATION, 0, cv2.THRESH_TRUNC)
        result[:_SIGNED + _UNSIGNED] += truncated
        truncated[:_SIGNED].sum(axis=0, out=energy)
    result[:_SIGNED + _UNSIGNED] *= 0.5
    energies *= _TEXTURE_GAIN
    return np.ascontiguousarray(result.T).reshape(*histogram.shape[1:], HOG_CHANNELS)


def _histogram(patches: np.ndarray, cell: int) -> np.ndarray:
    """
    Return the votes per signed orientation and cell, shape (18, n, H // cell, W // cell).

    Each gradient votes in its row for two orientations in two columns of cells; the rows of
    pixels then share theirs between two rows of cells.
    """
    count, height, width = patches.shape
    # One orientation more than there are, and a column of cells beyond each border.
    bins, columns = _SIGNED + 1, width // cell + 2
    places, votes = _shared_votes(patches, cell, (bins, columns))
    total = np.bincount(places.ravel(), votes.ravel(), count * height * bins * columns)
    rows = total.astype(np.float32).reshape(count, height, bins * columns)
    cells = (_triangles(height, cell) @ rows).reshape(count, -1, bins, columns)[..., 1:-1]
    cells[:, :, 0] += cells[:, :, _SIGNED]
    return np.ascontiguousarray(cells[:, :, :_SIGNED].transpose(2, 0, 1, 3))


def _shared_votes(patches: np.ndarray, cell: int,
                  shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the four votes of each pixel, and their places in (n * H, *shape), flat."""
    magnitude, lower, upper_vote = _votes(patches)
    left, right_share = _columns(patches.shape[2], cell)
    row = np.arange(len(lower), dtype=np.int32)[:, None] * (shape[0] * shape[1])
    places, votes = np.empty((4, *lower.shape), np.intp), np.empty((4, *lower.shape))
    np.add(lower * shape[1], row + left, out=places[0])
    np.add(places[0], shape[1], out=places[1])
    np.add(places[:2], 1, out=places[2:])
    np.subtract(magnitude, upper_vote, out=votes[0])
    votes[1] = upper_vote
    np.multiply(votes[:2], right_share, out=votes[2:])
    votes[:2] -= votes[2:]
    return places, votes


def _votes(patches: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return how strongly each pixel votes, and for what, each of shape (n * H, W).

    Returns
    -------
    magnitude : ndarray, float32
        The whole vote.
    lower : ndarray, int32
        First of the two signed orientations, 0..17, between which it is shared.
    upper_vote : ndarray, float32
        Share of the second one, which behind the last is the first.

    """
    dx, dy = (_differences(patches, axis).reshape(-1, patches.shape[2]) for axis in (2, 1))
    magnitude, angle = cv2.cartToPolar(dx, dy)
    angle *= np.float32(_SIGNED / (2 * np.pi))
    lower = np.minimum(np.floor(angle), _SIGNED - 1)
    angle -= lower
    angle *= magnitude
    return magnitude, lower.astype(np.int32), angle


def _differences(patches: np.ndarray, axis: int) -> np.ndarray:
    """Return the central differences along an axis, one-sided at the border."""
    result = np.empty_like(patches)
    pixels, differences = patches.swapaxes(0, axis), result.swapaxes(0, axis)
    np.subtract(pixels[2:], pixels[:-2], out=differences[1:-1])
    np.subtract(pixels[1], pixels[0], out=differences[0])
    np.subtract(pixels[-1], pixels[-2], out=differences[-1])
    return result


@lru_cache(maxsize=16)
def _columns(width: int, cell: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the left one of each pixel's two cells, the first being 0, and the right's share."""
    position = (np.arange(width) + 0.5) / cell + 0.5
    left = position.astype(np.int32)
    return left, position - left


@lru_cache(maxsize=16)
def _triangles(height: int, cell: int) -> np.ndarray:
    """Return the share of each pixel in each cell, linear, shape (H // cell, H)."""
    position = (np.arange(height) + 0.5) / cell - 0.5
    share = np.maximum(0, 1 - np.abs(np.arange(height // cell)[:, None] - position))
    return share.astype(np.float32)


def _normalizers(unsigned: np.ndarray, noise_energy: float) -> list[np.ndarray]:
    """Return, for each of the four blocks around a cell, one over its norm, (n, ...)."""
    rows, columns = (np.arange(-1, size + 1).clip(0, size - 1) for size in unsigned.shape[2:])
    energy = (unsigned**2).sum(axis=0)[:, rows[:, None], columns]
    pairs = energy[:, 1:] + energy[:, :-1]
    blocks = 1 / np.sqrt(pairs[..., 1:] + pairs[..., :-1] + np.float32(noise_energy))
    return [blocks[..., 1:, 1:], blocks[..., :-1, 1:], blocks[..., 1:, :-1], blocks[..., :-1, :-1]]
