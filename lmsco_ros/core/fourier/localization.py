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

"""The maximum of a score function, refined on its series (paper, (1))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.core.backend import Array, to_numpy
from lmsco_ros.core.fourier.series import bandwidth, grid_size, half_weights, synthesize

__all__ = ['Peak', 'centered_map', 'locate', 'refine']


@dataclass(frozen=True)
class Peak:
    """
    Maximum of the scores of several scales.

    Attributes
    ----------
    displacement : tuple of float
        (dy, dx) in periods, in [-1/2, 1/2).
    scale_index : int
        Scale whose score is the highest.
    value : float
        Score at the maximum.
    grid : ndarray, shape (n, n)
        Scores of that scale on the grid; the origin is at [0, 0].
    scale_values : ndarray, shape (n_scales,)
        Highest score of each scale on the grid.

    """

    displacement: tuple[float, float]
    scale_index: int
    value: float
    grid: np.ndarray
    scale_values: np.ndarray


def locate(scores: Array, grid_points: int, newton_steps: int) -> Peak:
    """
    Find the best scale and the position of its maximum.

    Parameters
    ----------
    scores : array, shape (2K + 1, K + 1, n_scales)
        Series of the score, one per scale.
    grid_points : int
        Points per axis of the coarse search, at least 2K + 1.
    newton_steps : int
        Steps of the refinement.

    """
    grids = to_numpy(synthesize(scores, grid_points))
    row, column, scale = np.unravel_index(np.argmax(grids), grids.shape)
    start = (float(row) / grid_points, float(column) / grid_points)
    displacement, value = refine(to_numpy(scores[..., int(scale)]), start, newton_steps)
    wrapped = (_wrap(displacement[0]), _wrap(displacement[1]))
    return Peak(wrapped, int(scale), value, grids[..., scale], grids.max(axis=(0, 1)))


def _wrap(t: float) -> float:
    """Move a position of the period to [-1/2, 1/2)."""
    return (t + 0.5) % 1.0 - 0.5


def refine(series: np.ndarray, start: tuple[float, float],
           steps: int) -> tuple[tuple[float, float], float]:
    """
    Climb from `start` to the maximum of a series with Newton's method.

    Parameters
    ----------
    series : ndarray, shape (2K + 1, K + 1)
        Score function.
    start : tuple of float
        (ty, tx) in periods.
    steps : int
        Newton steps, each at most half a point of the grid that carries the series. Where the
        function is not concave, its curvature counts as if it were.

    Returns
    -------
    tuple
        Position (ty, tx) and value; `start` and its value where Newton lowered the score.

    """
    order = bandwidth(series)
    weighted = series.astype(np.complex128) * half_weights(series)
    ky = 2j * np.pi * np.arange(-order, order + 1)
    kx = 2j * np.pi * np.arange(order + 1)
    position = start
    first = _value(weighted, ky, kx, start)
    for _ in range(steps):
        step = _ascent(*_derivatives(weighted, ky, kx, position))
        step *= min(1.0, 0.5 / (grid_size(order) * max(float(np.hypot(*step)), 1e-12)))
        position = (position[0] + float(step[0]), position[1] + float(step[1]))
    value = _value(weighted, ky, kx, position)
    return (position, value) if value >= first else (start, first)


def _ascent(gradient: np.ndarray, hessian: np.ndarray) -> np.ndarray:
    """Return the Newton step uphill: gradient over the absolute curvatures."""
    curvatures, directions = np.linalg.eigh(hessian)
    bounded = np.maximum(np.abs(curvatures), 1e-12 * np.abs(curvatures).max() + 1e-300)
    return directions @ ((directions.T @ gradient) / bounded)


def _value(weighted: np.ndarray, ky: np.ndarray, kx: np.ndarray,
           position: tuple[float, float]) -> float:
    """Return the function value at `position`."""
    return float((np.exp(ky * position[0]) @ weighted @ np.exp(kx * position[1])).real)


def _derivatives(weighted: np.ndarray, ky: np.ndarray, kx: np.ndarray,
                 position: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return gradient (2,) and Hessian (2, 2) at `position`."""
    rows = np.exp(ky * position[0])
    columns = np.exp(kx * position[1])
    left = np.stack([rows, ky * rows, ky**2 * rows])
    right = np.stack([columns, kx * columns, kx**2 * columns])
    d = (left @ weighted @ right.T).real
    return (np.array([d[1, 0], d[0, 1]]), np.array([[d[2, 0], d[1, 1]], [d[1, 1], d[0, 2]]]))


def centered_map(grid: np.ndarray) -> np.ndarray:
    """Return the score grid with the origin in the middle, as float32."""
    half = (grid.shape[0] // 2, grid.shape[1] // 2)
    return np.roll(grid, half, axis=(0, 1)).astype(np.float32)
