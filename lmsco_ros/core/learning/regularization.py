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

"""Spatial window that keeps the filter on the target (paper, (6); SRDCF, C-COT)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.core.backend import Array, array_namespace, Backend, real_matmul

__all__ = ['CrossSeries', 'SpatialWindow', 'window_series']


@dataclass(frozen=True)
class CrossSeries:
    """
    Series of gamma(t) = constant + u(ty) + v(tx), non-zero on the two axes only.

    Attributes
    ----------
    constant : float
        Coefficient at k = 0.
    vertical, horizontal : ndarray, shape (r,)
        Real, symmetric coefficients of u and v for the frequencies 1..r.

    """

    constant: float
    vertical: np.ndarray
    horizontal: np.ndarray

    @property
    def energy(self) -> float:
        """Sum of the squares of all coefficients: the mean of gamma(t)^2."""
        return float(self.constant**2 + 2 * np.sum(self.vertical**2)
                     + 2 * np.sum(self.horizontal**2))


def window_series(target: tuple[float, float], minimum: float, edge: float,
                  threshold: float) -> CrossSeries:
    """
    Return the sparse series of the spatial window gamma (paper, (6)).

    Parameters
    ----------
    target : tuple of float
        (h, w) of the target in periods.
    minimum, edge : float
        Window at the center of the target, and in the middle of its sides.
    threshold : float
        Coefficients below this part of the largest one are dropped.

    Notes
    -----
    gamma(y, x) = minimum + (edge - minimum) ((2 y / h)^2 + (2 x / w)^2), y and x from the
    middle of the period, where the filter lives. The parabola (t - 1/2)^2 on [0, 1) has
    the coefficients 1 / 12 at k = 0 and 1 / (2 pi^2 k^2) elsewhere, all of them positive. What
    the threshold takes away lowers the minimum, which the constant then restores.

    """
    curvature = [(edge - minimum) * (2 / side)**2 for side in target]
    largest = minimum + sum(curvature) / 12
    frequencies = np.arange(1, 64)
    axes = [c / (2 * np.pi**2 * frequencies**2) for c in curvature]
    axes = [axis[axis >= threshold * largest] for axis in axes]
    trough = sum(2 * float(np.sum(axis * (-1.0)**frequencies[:len(axis)])) for axis in axes)
    return CrossSeries(minimum - trough, axes[0], axes[1])


class SpatialWindow:
    """
    The operator G: multiply a function by the window and keep its band.

    The cross acts along one axis at a time, as two banded matrices: the convolution with the
    coefficients of u runs over ky, the one with those of v over kx, where the frequencies
    kx < 0 come from the mirrored half.

    Parameters
    ----------
    series : CrossSeries
        The window.
    order : int
        Bandwidth of the filters.
    backend : Backend
        Where the filters live.

    """

    def __init__(self, series: CrossSeries, order: int, backend: Backend) -> None:
        self.energy = series.energy
        rows = _banded(series.vertical, np.arange(-order, order + 1), np.arange(-order, order + 1))
        rows += series.constant * np.eye(len(rows))
        self._reach = min(len(series.horizontal), order)
        columns = _banded(series.horizontal, np.arange(order + 1),
                          np.arange(-self._reach, order + 1))
        self._rows = backend.asarray(rows)
        self._columns = backend.asarray(columns)

    def apply(self, series: Array) -> Array:
        """
        Return G W; G is its own adjoint.

        Parameters
        ----------
        series : array, shape (2K + 1, K + 1, C)
            Filter coefficients.

        """
        xp = array_namespace(series)
        mirrored = xp.conj(xp.flip(series[:, 1:self._reach + 1, :], axis=(0, 1)))
        result = real_matmul(self._columns, xp.concat([mirrored, series], axis=1))
        along = real_matmul(self._rows, xp.reshape(series, (series.shape[0], -1)))
        result += xp.reshape(along, series.shape)
        return result

    def gram(self, series: Array) -> Array:
        """Return G^H G W."""
        return self.apply(self.apply(series))


def _banded(coefficients: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the matrix with entry c[|row - column|], zero where that is 0 or above r."""
    padded = np.zeros(int(np.max(rows) - np.min(columns)) + len(coefficients) + 1)
    padded[1:len(coefficients) + 1] = coefficients
    return padded[np.abs(rows[:, None] - columns[None, :])]
