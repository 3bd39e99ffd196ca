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

"""The spatial window against multiplication on a fine grid."""

import numpy as np
import pytest

from lmsco_ros.core.fourier.series import analyze, inner, synthesize
from lmsco_ros.core.learning.regularization import SpatialWindow, window_series

CCOT = (1e-4, 10e-3, 0.05)
CASES = [
    ((0.2, 0.2), *CCOT),
    ((0.13, 0.31), *CCOT),
    ((0.4, 0.1), *CCOT),
    ((0.2, 0.2), 0.03, 0.05, 0.05),
    ((0.5, 0.15), 0.1, 3.0, 0.02),
]


def window_values(series, size):
    """Return gamma(t) = constant + u(ty) + v(tx) on a grid."""
    t = np.arange(size) / size
    axes = [sum((2 * c * np.cos(2 * np.pi * (k + 1) * t) for k, c in enumerate(axis)),
                np.zeros(size)) for axis in (series.vertical, series.horizontal)]
    return series.constant + axes[0][:, None] + axes[1][None, :]


@pytest.mark.parametrize('target, minimum, edge, threshold', CASES)
def test_window_is_the_thresholded_parabola(parabolic_window, target, minimum, edge, threshold):
    expected, count = parabolic_window(target, minimum, edge, threshold, 60)
    series = window_series(target, minimum, edge, threshold)
    np.testing.assert_allclose(window_values(series, 60), expected, rtol=3e-4)
    assert 1 + 2 * len(series.vertical) + 2 * len(series.horizontal) == count


def test_usual_numbers_leave_a_cross_of_nine():
    series = window_series((0.2, 0.2), *CCOT)
    assert len(series.vertical) == len(series.horizontal) == 2


@pytest.mark.parametrize('target, minimum, edge, threshold', CASES)
def test_minimum_is_restored_in_the_middle(target, minimum, edge, threshold):
    values = window_values(window_series(target, minimum, edge, threshold), 240)
    assert values.min() == pytest.approx(minimum, rel=1e-9)
    assert values[120, 120] == pytest.approx(minimum, rel=1e-9)


def test_narrow_side_is_held_more_tightly():
    values = window_values(window_series((0.4, 0.1), *CCOT), 240)
    assert values[120, 160] > 4 * values[160, 120]


def test_untruncated_window_passes_through_the_middle_of_the_sides():
    values = window_values(window_series((0.25, 0.5), 0.1, 0.7, 0.0), 240)
    assert values[150, 120] == pytest.approx(0.7, abs=0.05)
    assert values[120, 180] == pytest.approx(0.7, abs=0.05)


def test_energy_is_the_mean_square():
    series = window_series((0.2, 0.3), *CCOT)
    assert series.energy == pytest.approx(np.mean(window_values(series, 240)**2), rel=1e-12)


@pytest.mark.parametrize('target', [(0.2, 0.2), (0.13, 0.31), (0.4, 0.1)])
@pytest.mark.parametrize('order', [1, 3, 6])
def test_operator_multiplies_in_space_and_keeps_the_band(
        backend, band, parabolic_window, rng, target, order):
    gamma, _ = parabolic_window(target, *CCOT, 64)
    filters = analyze(rng.normal(size=(2 * order + 1,) * 2 + (3,)))
    space = band(order, 64)
    expected = space.series(gamma[:, :, None] * space.values(filters))
    window = SpatialWindow(window_series(target, *CCOT), order, backend)
    np.testing.assert_allclose(window.apply(filters), expected, atol=1e-6)
    np.testing.assert_allclose(window.gram(filters), window.apply(window.apply(filters)))


@pytest.mark.parametrize('order', [0, 1, 2, 5])
def test_operator_is_its_own_adjoint(backend, rng, order):
    window = SpatialWindow(window_series((0.2, 0.35), *CCOT), order, backend)
    one, other = (analyze(rng.normal(size=(2 * order + 1,) * 2 + (2,))) for _ in range(2))
    np.testing.assert_allclose(inner(window.apply(one), other), inner(one, window.apply(other)),
                               rtol=1e-12)
    assert np.all(inner(one, window.gram(one)) > 0)


def test_result_is_a_real_function(backend, rng):
    window = SpatialWindow(window_series((0.2, 0.2), *CCOT), 4, backend)
    result = window.apply(analyze(rng.normal(size=(9, 9, 2))))
    np.testing.assert_allclose(result[::-1, 0], result[:, 0].conj(), atol=1e-15)


def test_input_is_left_alone(backend, rng):
    filters = analyze(rng.normal(size=(9, 9, 2)))
    before = filters.copy()
    SpatialWindow(window_series((0.2, 0.2), *CCOT), 4, backend).gram(filters)
    np.testing.assert_array_equal(filters, before)


def test_filter_far_from_the_target_costs_more(backend):
    t = np.arange(21) / 21
    bump = np.exp(8 * (np.cos(2 * np.pi * (t - 0.5)) - 1))
    on_target = analyze((bump[:, None] * bump[None, :])[:, :, None])
    window = SpatialWindow(window_series((0.2, 0.2), *CCOT), 10, backend)
    off_target = analyze(np.roll(synthesize(on_target, 21), 7, axis=1))
    costs = [float(inner(f, window.gram(f))[0]) for f in (on_target, off_target)]
    assert costs[1] > 10 * costs[0]
