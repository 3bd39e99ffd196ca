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

"""The refined maximum against fine grids."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.fourier.localization import (
    centered_map, curvature, locate, peak_to_sidelobe_ratio, refine)
from lmsco_ros.core.fourier.series import analyze, synthesize


def bump(size, center, sharpness=6.0, height=1.0):
    """Return a smooth periodic bump around `center` on a grid."""
    t = np.arange(size) / size
    rows = np.cos(2 * np.pi * (t - center[0])) - 1
    columns = np.cos(2 * np.pi * (t - center[1])) - 1
    return height * np.exp(sharpness * (rows[:, None] + columns[None, :]))


def distance(one, other):
    """Return the distance of two points of the period."""
    gap = (np.asarray(one) - np.asarray(other) + 0.5) % 1 - 0.5
    return float(np.abs(gap).max())


@given(y=st.floats(-0.5, 0.49), x=st.floats(-0.5, 0.49))
def test_position_of_a_known_bump(y, x):
    series = analyze(bump(41, (y, x)))
    peak = locate(series[:, :, None], 41, 5)
    assert distance(peak.displacement, (y, x)) < 1e-9
    assert peak.value == pytest.approx(1, abs=1e-9)
    assert all(-0.5 <= d < 0.5 for d in peak.displacement)


@given(seed=st.integers(0, 2**32 - 1))
def test_refined_maximum_of_a_random_score_beats_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    series = analyze(rng.normal(size=(9, 9)))
    coarse = synthesize(series, 27)
    fine = synthesize(series, 27 * 11)
    peak = locate(series[:, :, None], 27, 8)
    assert peak.value >= coarse.max() - 1e-12
    # Where the coarse grid found the right hill, nothing of the fine grid lies above.
    near = np.unravel_index(np.argmax(fine), fine.shape)
    if distance(np.array(near) / fine.shape[0], peak.displacement) < 1 / 27:
        assert peak.value >= fine.max() - 1e-9
        assert distance(np.array(near) / fine.shape[0], peak.displacement) < 1 / (27 * 11)


def test_value_and_grid_belong_to_the_position(evaluate, rng):
    series = analyze(rng.normal(size=(7, 7)))
    peak = locate(series[:, :, None], 15, 5)
    assert peak.value == pytest.approx(evaluate(series, *peak.displacement), abs=1e-12)
    np.testing.assert_allclose(peak.grid, synthesize(series, 15), atol=1e-13)


def test_best_scale_wins():
    scores = np.stack([analyze(bump(41, c, height=h)) for c, h in (
        ((0.1, 0.2), 0.7), ((-0.2, 0.3), 1.1), ((0.4, -0.1), 0.9))], axis=2)
    peak = locate(scores, 41, 5)
    assert peak.scale_index == 1
    assert distance(peak.displacement, (-0.2, 0.3)) < 1e-9
    assert peak.value == pytest.approx(1.1, abs=1e-9)


def test_scale_is_chosen_after_the_refinement():
    """The grid meets the lower one exactly, and the higher one between its points."""
    scores = np.stack([analyze(bump(9, center, sharpness=1.5, height=height))
                       for center, height in (((0, 0), 1.0), ((1 / 18, 1 / 18), 1.04))], axis=2)
    grids = synthesize(scores, 9)
    assert grids[..., 0].max() > grids[..., 1].max()
    peak = locate(scores, 9, 5)
    assert peak.scale_index == 1 and peak.value > 1.02
    np.testing.assert_allclose(peak.grid, grids[..., 1])
    assert peak.scale_values[1] == pytest.approx(peak.value) and peak.scale_values[0] >= 1 - 1e-9
    # Without it the grid decides.
    assert locate(scores, 9, 0).scale_index == 0


def test_gains_count_in_the_choice_but_not_in_the_value():
    scores = np.stack([analyze(bump(41, (0.1, 0.2), height=h)) for h in (0.7, 1.0)], axis=2)
    peak = locate(scores, 41, 5, [2.0, 1.0])
    assert peak.scale_index == 0 and peak.value == pytest.approx(0.7)
    np.testing.assert_allclose(peak.scale_values, [1.4, 1.0])


def test_no_newton_steps_is_the_grid_maximum(rng):
    series = analyze(rng.normal(size=(9, 9)))
    grid = synthesize(series, 9)
    peak = locate(series[:, :, None], 9, 0)
    row, column = np.unravel_index(np.argmax(grid), grid.shape)
    assert distance(peak.displacement, (row / 9, column / 9)) < 1e-15
    assert peak.value == pytest.approx(grid.max())


@pytest.mark.parametrize('start', [(0.5, 0.5), (0.25, 0.25), (0.5, 0.0), (0.24, 0.26)])
def test_a_start_where_the_score_is_not_concave_does_no_harm(evaluate, start):
    t = np.arange(9) / 9
    series = analyze(np.cos(2 * np.pi * t)[:, None] + np.cos(2 * np.pi * t)[None, :])
    position, value = refine(series, start, 5)
    assert value >= evaluate(series, *start) - 1e-12
    assert value == pytest.approx(evaluate(series, *position), abs=1e-12)


@given(seed=st.integers(0, 2**32 - 1), y=st.floats(0, 1), x=st.floats(0, 1))
def test_newton_never_ends_below_its_start(seed, y, x):
    series = analyze(np.random.default_rng(seed).normal(size=(7, 7)))
    start_value = refine(series, (y, x), 0)[1]
    assert refine(series, (y, x), 6)[1] >= start_value


@pytest.mark.parametrize('y, x', [(0, 0), (0.3, 0.8), (0.51, 0.07)])
def test_curvature_is_that_of_differences(evaluate, rng, y, x):
    series = analyze(rng.normal(size=(7, 7)))
    h = 1e-4

    def at(i, j):
        return evaluate(series, y + i * h, x + j * h)
    yy = at(1, 0) - 2 * at(0, 0) + at(-1, 0)
    xx = at(0, 1) - 2 * at(0, 0) + at(0, -1)
    yx = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4
    np.testing.assert_allclose(curvature(series, (y, x)),
                               np.array([[yy, yx], [yx, xx]]) / h**2, rtol=1e-4, atol=1e-3)


def test_flat_score_keeps_the_origin():
    peak = locate(np.zeros((5, 3, 2), complex), 5, 5)
    assert peak.displacement == (0, 0) and peak.value == 0


@pytest.mark.parametrize('size', [5, 6])
def test_map_has_the_origin_in_the_middle(rng, size):
    grid = rng.normal(size=(size, size))
    centered = centered_map(grid)
    assert centered.dtype == np.float32
    assert centered[size // 2, size // 2] == np.float32(grid[0, 0])
    assert centered[size // 2 + 1, size // 2 - 1] == np.float32(grid[1, -1])


def slow_ratio(grid, exclude):
    """Return the peak-to-sidelobe ratio point by point."""
    size = grid.shape[0]
    row, column = np.unravel_index(np.argmax(grid), grid.shape)
    rest = []
    for i, j in np.ndindex(grid.shape):
        distance = max(min((i - row) % size, (row - i) % size),
                       min((j - column) % size, (column - j) % size))
        if distance > exclude:
            rest.append(grid[i, j])
    return (grid[row, column] - np.mean(rest)) / np.std(rest)


@given(seed=st.integers(0, 2**32 - 1), size=st.integers(7, 15), exclude=st.integers(0, 2))
def test_ratio_is_that_of_the_loop(seed, size, exclude):
    grid = np.random.default_rng(seed).normal(size=(size, size))
    assert peak_to_sidelobe_ratio(grid, exclude) == pytest.approx(slow_ratio(grid, exclude))


@given(seed=st.integers(0, 2**32 - 1), gain=st.floats(0.1, 10), offset=st.floats(-5, 5),
       move=st.tuples(st.integers(0, 12), st.integers(0, 12)))
def test_ratio_knows_neither_gain_nor_offset_nor_place(seed, gain, offset, move):
    grid = np.random.default_rng(seed).normal(size=(13, 13))
    other = gain * np.roll(grid, move, axis=(0, 1)) + offset
    assert peak_to_sidelobe_ratio(other, 2) == pytest.approx(peak_to_sidelobe_ratio(grid, 2))


def test_sharp_peak_over_noise_beats_noise(rng):
    noise = rng.normal(size=(31, 31))
    peak = noise.copy()
    peak[5, 30] += 20
    assert peak_to_sidelobe_ratio(peak, 2) > 3 * peak_to_sidelobe_ratio(noise, 2)


def test_flat_scores_are_not_sharp():
    assert peak_to_sidelobe_ratio(np.zeros((9, 9)), 1) == 0
    assert peak_to_sidelobe_ratio(np.full((9, 9), 3.3, np.float32), 1) < 1
