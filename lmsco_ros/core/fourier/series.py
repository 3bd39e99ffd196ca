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

"""
Half spectra of real periodic functions in two dimensions, and what is done with them.

A real function s(t), t = (ty, tx) in [0, 1)^2, of bandwidth K is::

    s(t) = sum_{|ky|, |kx| <= K} S[ky, kx] exp(2 pi i (ky ty + kx tx)).

Since S[-k] = conj(S[k]), only the half kx >= 0 is kept. A *series* is a complex array of
shape (2K + 1, K + 1, ...): ky runs from -K to K, kx from 0 to K; the axes behind are channels
or samples. Sums over the whole spectrum are recovered with the weights of `half_weights`.
"""

from __future__ import annotations

from array_api_compat import device

from lmsco_ros.core.backend import Array, array_namespace, irfft2, rfft2

__all__ = ['analyze', 'bandwidth', 'crop', 'embed', 'grid_size', 'half_weights', 'inner',
           'mean_of_squares', 'shift', 'symmetrize', 'synthesize', 'value_at_origin']


def bandwidth(series: Array) -> int:
    """Return K of a series of shape (2K + 1, K + 1, ...)."""
    return int(series.shape[1]) - 1


def grid_size(order: int) -> int:
    """Return the points per axis, 2K + 1, that carry a series of bandwidth `order` exactly."""
    return 2 * order + 1


def analyze(values: Array) -> Array:
    """
    Return the series of a function given on a regular grid.

    Parameters
    ----------
    values : array, shape (N, N, ...)
        Samples at t = n / N. An even N loses its Nyquist frequency.

    Returns
    -------
    array, shape (2K + 1, K + 1, ...), K = (N - 1) // 2
        Coefficients, the grid mean at k = 0.

    """
    size = int(values.shape[0])
    order = (size - 1) // 2
    xp = array_namespace(values)
    spectrum = rfft2(values)
    centered = xp.concat([spectrum[size - order:, :order + 1], spectrum[:order + 1, :order + 1]],
                         axis=0)
    centered *= 1.0 / size**2
    return centered


def synthesize(series: Array, size: int) -> Array:
    """
    Return the values of a series on the grid t = n / size.

    Parameters
    ----------
    series : array, shape (2K + 1, K + 1, ...)
        Coefficients.
    size : int
        Points per axis, at least 2K + 1.

    Returns
    -------
    array, shape (size, size, ...)
        Real values.

    """
    xp = array_namespace(series)
    order = bandwidth(series)
    gap = xp.zeros((size - grid_size(order), *series.shape[1:]), dtype=series.dtype,
                   device=device(series))
    spectrum = xp.concat([series[order:], gap, series[:order]], axis=0)
    values = irfft2(spectrum, size)
    values *= size**2
    return values


def half_weights(series: Array) -> Array:
    """Return, for each kx >= 0, how often its column stands in the whole spectrum (1 or 2)."""
    xp = array_namespace(series)
    real = xp.real(series[:1, :1]).dtype
    weights = xp.full((series.shape[1],), 2.0, dtype=real, device=device(series))
    weights[0] = 1.0
    return weights


def inner(left: Array, right: Array) -> Array:
    """Return the mean of left(t) right(t) over one period, per trailing index."""
    xp = array_namespace(left)
    product = xp.real(xp.conj(left) * right)
    weights = xp.reshape(half_weights(left), (1, -1) + (1,) * (product.ndim - 2))
    return xp.sum(product * weights, axis=(0, 1))


def mean_of_squares(series: Array) -> Array:
    """Return the mean of s(t)^2 over one period (Parseval), per trailing index."""
    return inner(series, series)


def value_at_origin(series: Array) -> Array:
    """Return s(0), the sum of all coefficients, per trailing index."""
    xp = array_namespace(series)
    columns = xp.sum(xp.real(series), axis=0)
    return 2 * xp.sum(columns, axis=0) - columns[0, ...]


def symmetrize(series: Array) -> Array:
    """Return the series with S[-ky, 0] = conj(S[ky, 0]), which rounding slowly breaks."""
    xp = array_namespace(series)
    column = series[:, :1, ...]
    column = (column + xp.conj(xp.flip(column, axis=0))) / 2
    return xp.concat([column, series[:, 1:, ...]], axis=1)


def shift(series: Array, displacement: tuple[float, float]) -> Array:
    """
    Return the series of s(t + displacement).

    Parameters
    ----------
    series : array, shape (2K + 1, K + 1, ...)
        Coefficients.
    displacement : tuple of float
        (dy, dx) in periods: what was at `displacement` comes to the origin.

    """
    xp = array_namespace(series)
    order = bandwidth(series)
    rows = _phase(series, range(-order, order + 1), displacement[0])
    columns = _phase(series, range(order + 1), displacement[1])
    phase = rows[:, None] * columns[None, :]
    return series * xp.reshape(phase, phase.shape + (1,) * (series.ndim - 2))


def _phase(series: Array, frequencies: range, displacement: float) -> Array:
    """Return exp(2 pi i k displacement) for each k."""
    xp = array_namespace(series)
    angle = xp.asarray([2 * xp.pi * k * displacement for k in frequencies], dtype=series.dtype,
                       device=device(series))
    return xp.exp(1j * angle)


def embed(series: Array, order: int) -> Array:
    """Return the same function as a series of the larger bandwidth `order`."""
    own = bandwidth(series)
    if own == order:
        return series
    xp = array_namespace(series)
    result = xp.zeros((grid_size(order), order + 1, *series.shape[2:]), dtype=series.dtype,
                      device=device(series))
    result[order - own:order + own + 1, :own + 1, ...] = series
    return result


def crop(series: Array, order: int) -> Array:
    """Return the part of the series inside the smaller bandwidth `order`; adjoint of `embed`."""
    own = bandwidth(series)
    if own == order:
        return series
    return series[own - order:own + order + 1, :order + 1, ...]
