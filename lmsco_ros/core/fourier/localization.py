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

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
import math

import numpy as np

from lmsco_ros.core.backend import Array, to_numpy
from lmsco_ros.core.fourier.series import bandwidth, grid_size, half_weights, synthesize

__all__ = ['Peak', 'centered_map', 'curvature', 'locate', 'peak_to_sidelobe_ratio', 'refine']

# In periods; the next step of Newton's method would be about the square of it.
_SMALLEST_STEP = 1e-7


@dataclass(frozen=True)
class Peak:
    """
    Maximum of the scores of several scales.

    Attributes
    ----------
    displacement : tuple of float
        (dy, dx) in periods, in [-1/2, 1/2).
    scale_index : int
        Scale whose maximum is the highest.
    value : float
        Score at the maximum.
    grid : ndarray, shape (n, n)
        Scores of that scale on the grid; the origin is at [0, 0].
    scale_values : ndarray, shape (n_scales,)
        Maximum of each scale, times its gain.

    """

    displacement: tuple[float, float]
    scale_index: int
    value: float
    grid: np.ndarray
    scale_values: np.ndarray


def locate(scores: Array, grid_points: int, newton_steps: int,
           gains: Sequence[float] = (1.0,)) -> Peak:
    """
    Find the maximum of each scale, and the best scale (paper, (1)).

    Parameters
    ----------
    scores : array, shape (2K + 1, K + 1, n_scales)
        Series of the score, one per scale.
    grid_points : int
        Points per axis of the coarse search, at least 2K + 1.
    newton_steps : int
        Steps of the refinement.
    gains : sequence of float
        What the maxima count for in the choice of the scale; one for all, or one for each.

    """
    grids, series = to_numpy(synthesize(scores, grid_points)), to_numpy(scores)
    rows, columns = np.unravel_index(
        grids.reshape(-1, grids.shape[2]).argmax(axis=0), grids.shape[:2])
    # A grid meets the maximum of one scale nearer than that of another.
    found = [refine(series[..., scale], (row / grid_points, column / grid_points), newton_steps)
             for scale, (row, column) in enumerate(zip(rows.tolist(), columns.tolist()))]
    values = np.array([value for _, value in found]) * gains
    scale = int(values.argmax())
    (y, x), value = found[scale]
    return Peak((_wrap(y), _wrap(x)), scale, value, grids[..., scale], values)


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
        Newton steps at most, each at most half a point of the grid that carries the series.
        Where the function is not concave, its curvature counts as if it were.

    Returns
    -------
    tuple
        Position (ty, tx) and value; `start` and its value where Newton lowered the score.

    """
    order = bandwidth(series)
    weighted = series.astype(np.complex128) * half_weights(series)
    position, derivatives = start, _derivatives(weighted, start)
    first = derivatives[0, 0]
    for _ in range(steps):
        step = _ascent(derivatives)
        length = math.hypot(*step)
        part = min(1.0, 0.5 / (grid_size(order) * max(length, 1e-12)))
        position = (position[0] + part * step[0], position[1] + part * step[1])
        derivatives = _derivatives(weighted, position)
        if length < _SMALLEST_STEP:
            break
    value = derivatives[0, 0]
    return (position, float(value)) if value >= first else (start, float(first))


def curvature(series: np.ndarray, position: tuple[float, float]) -> np.ndarray:
    """
    Return the second derivatives of a series, [[yy, yx], [yx, xx]] per period squared.

    Parameters
    ----------
    series : ndarray, shape (2K + 1, K + 1)
        Score function.
    position : tuple of float
        (ty, tx) in periods.

    """
    weighted = series.astype(np.complex128) * half_weights(series)
    derivatives = _derivatives(weighted, position)
    return np.array([[derivatives[2, 0], derivatives[1, 1]],
                     [derivatives[1, 1], derivatives[0, 2]]])


def _ascent(derivatives: np.ndarray) -> tuple[float, float]:
    """Return the Newton step uphill: gradient over the absolute curvatures."""
    gradient = float(derivatives[1, 0]), float(derivatives[0, 1])
    yy, xx, yx = float(derivatives[2, 0]), float(derivatives[0, 2]), float(derivatives[1, 1])
    mean, half = (yy + xx) / 2, (yy - xx) / 2
    radius = math.hypot(half, yx)
    least = 1e-12 * (abs(mean) + radius) + 1e-300
    high, low = (1 / max(abs(curvature), least) for curvature in (mean + radius, mean - radius))
    # The inverse of the absolute Hessian is linear in the Hessian.
    same, slope = (high + low) / 2, (high - low) / (2 * radius) if radius > 0 else 0.0
    return (same * gradient[0] + slope * (half * gradient[0] + yx * gradient[1]),
            same * gradient[1] + slope * (yx * gradient[0] - half * gradient[1]))


def _derivatives(weighted: np.ndarray, position: tuple[float, float]) -> np.ndarray:
    """Return the derivatives at `position`, [i, j] being the i-th in y and the j-th in x."""
    order = bandwidth(weighted)
    rows, columns = _powers(-order, order), _powers(0, order)
    left = rows * np.exp(rows[1] * position[0])
    right = columns * np.exp(columns[1] * position[1])
    return (left @ weighted @ right.T).real


@lru_cache(maxsize=16)
def _powers(first: int, last: int) -> np.ndarray:
    """Return (2 pi i k)^p for p = 0, 1, 2 and the frequencies k from first to last."""
    return (2j * np.pi * np.arange(first, last + 1))**np.arange(3)[:, None]


def centered_map(grid: np.ndarray) -> np.ndarray:
    """Return the score grid with the origin in the middle, as float32."""
    half = (grid.shape[0] // 2, grid.shape[1] // 2)
    return np.roll(grid, half, axis=(0, 1)).astype(np.float32)


def peak_to_sidelobe_ratio(grid: np.ndarray, exclude: int) -> float:
    """
    Return (maximum - mean) / standard deviation, the latter two away from the peak.

    Parameters
    ----------
    grid : ndarray, shape (n, n)
        Scores, periodic.
    exclude : int
        Half side, in grid points, of the square around the peak that is not sidelobe.

    Notes
    -----
    Bolme et al., MOSSE, CVPR 2010.

    """
    size = grid.shape[0]
    row, column = np.unravel_index(np.argmax(grid), grid.shape)
    around = np.arange(-exclude, exclude + 1)
    values = grid.astype(np.float64)
    square = values[((row + around) % size)[:, None], (column + around) % size]
    count = values.size - square.size
    mean = (values.sum() - square.sum()) / count
    power = (np.vdot(values, values) - np.vdot(square, square)) / count
    deviation = math.sqrt(max(power - mean**2, 0.0))
    return float((grid[row, column] - mean) / deviation) if deviation > 0 else 0.0
