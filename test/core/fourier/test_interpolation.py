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

"""Interpolated channels against the cubic spline itself."""

import numpy as np
import pytest

from lmsco_ros.core.fourier import interpolation
from lmsco_ros.core.fourier.series import analyze


def keys_kernel(x, a=-0.75):
    """Return the cubic convolution kernel (Keys, 1981) at a distance in cells."""
    x = np.abs(x)
    near = (a + 2) * x**3 - (a + 3) * x**2 + 1
    far = a * x**3 - 5 * a * x**2 + 8 * a * x - 4 * a
    return np.where(x < 1, near, np.where(x < 2, far, 0.0))


def spline(cells, t):
    """Return the periodic spline through cells centered at (n + 1/2) / N, at points t."""
    size = len(cells)
    total = np.zeros((len(t),) + cells.shape[1:])
    for period in (-1, 0, 1):
        for n in range(size):
            weight = keys_kernel(size * (t - period) - (n + 0.5))
            total += weight.reshape(-1, *(1,) * (cells.ndim - 1)) * cells[n]
    return total


def coefficients(values, order):
    """Return the Fourier coefficients of densely sampled values along axis 0."""
    size = len(values)
    k = np.arange(-order, order + 1)
    waves = np.exp(-2j * np.pi * np.outer(k, (np.arange(size)) / size))
    return np.tensordot(waves, values, axes=1) / size


@pytest.mark.parametrize('frequency', [0.0, 1e-3, 0.1, 0.37, 0.5, 1.0, 1.3])
def test_spectrum_is_the_transform_of_the_kernel(frequency):
    x = np.linspace(-2, 2, 40001)
    values = keys_kernel(x) * np.cos(2 * np.pi * frequency * x)
    expected = np.sum((values[1:] + values[:-1]) / 2 * np.diff(x))
    tolerance = 1e-7 if frequency != 1e-3 else 1e-4  # cancellation in the closed form
    assert interpolation.cubic_spectrum(np.array([frequency]))[0] == pytest.approx(
        expected, abs=tolerance)


@pytest.mark.parametrize('size', [5, 7, 8, 9])
def test_series_is_the_band_of_the_spline(backend, rng, size):
    cells = rng.normal(size=(size, size, 2))
    kernel = backend.namespace.asarray(interpolation.interpolation_series(size)[:, :, None])
    series = interpolation.interpolate(backend.asarray(cells), kernel)
    dense = 64 * size
    t = np.arange(dense) / dense
    # The spline is separable: along y first, then along x.
    order = (size - 1) // 2
    rows = coefficients(spline(cells, t), order)
    columns = np.moveaxis(rows, 1, 0)
    real, imaginary = spline(columns.real, t), spline(columns.imag, t)
    expected = np.moveaxis(coefficients(real + 1j * imaginary, order), 0, 1)[:, order:]
    np.testing.assert_allclose(series, expected, atol=2e-6)


def test_a_cell_is_centered_on_its_middle(backend, evaluate):
    size = 9
    cells = np.zeros((size, size, 1))
    cells[4, 6] = 1
    kernel = backend.namespace.asarray(interpolation.interpolation_series(size)[:, :, None])
    series = interpolation.interpolate(backend.asarray(cells), kernel)[:, :, 0]
    ty, tx = 4.5 / size, 6.5 / size
    top = evaluate(series, ty, tx)
    for offset in (0.2 / size, 0.4 / size):
        assert evaluate(series, ty + offset, tx) == pytest.approx(
            evaluate(series, ty - offset, tx), abs=1e-12)
        assert evaluate(series, ty, tx + offset) == pytest.approx(
            evaluate(series, ty, tx - offset), abs=1e-12)
        assert evaluate(series, ty, tx + offset) < top


def test_input_is_left_alone(backend, rng):
    cells = backend.asarray(rng.normal(size=(7, 7, 1)))
    before = cells.copy()
    kernel = backend.namespace.asarray(interpolation.interpolation_series(7)[:, :, None])
    keep = kernel.copy()
    interpolation.interpolate(cells, kernel)
    np.testing.assert_array_equal(cells, before)
    np.testing.assert_array_equal(kernel, keep)


def test_constant_cells_stay_constant(backend):
    kernel = backend.namespace.asarray(interpolation.interpolation_series(9)[:, :, None])
    series = interpolation.interpolate(backend.asarray(np.full((9, 9, 1), 2.5)), kernel)
    np.testing.assert_allclose(series, analyze(np.full((9, 9, 1), 2.5)), atol=1e-14)
