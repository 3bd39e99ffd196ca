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

"""Half spectra against functions on grids and sums over whole spectra."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.fourier import series as fs

SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize('size', [1, 3, 5, 9, 15])
def test_odd_grids_survive_the_round_trip(backend, rng, size):
    values = backend.asarray(rng.normal(size=(size, size, 2)))
    series = fs.analyze(values)
    assert series.shape == (size, (size + 1) // 2, 2)
    np.testing.assert_allclose(fs.synthesize(series, size), values, atol=1e-13)


@pytest.mark.parametrize('size', [2, 4, 10])
def test_even_grids_lose_exactly_their_highest_frequency(backend, band, rng, size):
    values = backend.asarray(rng.normal(size=(size, size)))
    series = fs.analyze(values)
    order = (size - 1) // 2
    assert fs.bandwidth(series) == order
    kept = band(order, size)
    np.testing.assert_allclose(fs.synthesize(series, size), kept.values(kept.series(values)),
                               atol=1e-12)


def test_series_of_a_known_function():
    n = np.arange(9) / 9
    values = 0.5 + np.cos(2 * np.pi * (2 * n[:, None] - 3 * n[None, :])) + np.sin(
        2 * np.pi * n[:, None]) + 0 * n[None, :]
    expected = np.zeros((9, 5), complex)
    expected[4, 0] = 0.5
    expected[4 - 2, 3] = 0.5
    expected[4 + 1, 0], expected[4 - 1, 0] = -0.5j, 0.5j
    np.testing.assert_allclose(fs.analyze(values), expected, atol=1e-14)


@given(seed=SEEDS, order=st.integers(0, 5), extra=st.integers(0, 6))
def test_synthesis_sums_the_exponentials(seed, order, extra):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(2 * order + 1, 2 * order + 1))
    series = fs.analyze(values)
    size = 2 * order + 1 + extra
    grid = fs.synthesize(series, size)
    row, column = rng.integers(0, size, 2)
    k = np.arange(-order, order + 1)
    n = np.arange(2 * order + 1) / (2 * order + 1)
    spectrum = np.exp(-2j * np.pi * np.outer(k, n)) @ values @ np.exp(
        -2j * np.pi * np.outer(n, k)) / values.size
    expected = np.exp(2j * np.pi * k * row / size) @ spectrum @ np.exp(
        2j * np.pi * k * column / size)
    assert grid[row, column] == pytest.approx(expected.real, abs=1e-12)


@given(seed=SEEDS, order=st.integers(0, 6))
def test_inner_product_is_the_mean_over_the_grid(seed, order):
    rng = np.random.default_rng(seed)
    left, right = rng.normal(size=(2, 2 * order + 1, 2 * order + 1, 3))
    one, other = fs.analyze(left), fs.analyze(right)
    np.testing.assert_allclose(fs.inner(one, other), (left * right).mean(axis=(0, 1)),
                               atol=1e-12)
    np.testing.assert_allclose(fs.mean_of_squares(one), (left**2).mean(axis=(0, 1)), atol=1e-12)


def test_value_at_origin_is_the_first_grid_point(rng):
    values = rng.normal(size=(7, 7, 2, 3))
    np.testing.assert_allclose(fs.value_at_origin(fs.analyze(values)), values[0, 0], atol=1e-13)


def test_weights_count_the_mirrored_half(rng):
    series = fs.analyze(rng.normal(size=(9, 9)))
    weights = fs.half_weights(series)
    assert weights.tolist() == [1, 2, 2, 2, 2]
    assert weights.sum() * 9 == 81


def wave(ty, tx):
    """Return an analytic function of bandwidth 3."""
    return (1.5 + np.cos(2 * np.pi * (3 * ty - tx) + 0.3) - 2 * np.sin(2 * np.pi * (ty + 2 * tx))
            + np.cos(2 * np.pi * 3 * tx + 1))


@given(dy=st.floats(-2, 2), dx=st.floats(-2, 2))
def test_shift_brings_a_displacement_to_the_origin(dy, dx):
    t = np.arange(11) / 11
    series = fs.analyze(wave(t[:, None], t[None, :]))
    shifted = fs.synthesize(fs.shift(series, (dy, dx)), 11)
    np.testing.assert_allclose(shifted, wave(t[:, None] + dy, t[None, :] + dx), atol=1e-11)


def test_shift_moves_all_channels_alike(rng):
    values = rng.normal(size=(9, 9, 2, 2))
    moved = fs.synthesize(fs.shift(fs.analyze(values), (2 / 9, -1 / 9)), 9)
    np.testing.assert_allclose(moved, np.roll(values, (-2, 1), axis=(0, 1)), atol=1e-12)


@given(seed=SEEDS, small=st.integers(0, 4), more=st.integers(0, 4))
def test_crop_is_the_adjoint_of_embed(seed, small, more):
    rng = np.random.default_rng(seed)
    low = fs.analyze(rng.normal(size=(2 * small + 1,) * 2))
    high = fs.analyze(rng.normal(size=(2 * (small + more) + 1,) * 2))
    wide = fs.embed(low, small + more)
    assert wide.shape == high.shape
    assert fs.inner(wide, high) == pytest.approx(
        float(fs.inner(low, fs.crop(high, small))), abs=1e-12)
    np.testing.assert_array_equal(fs.crop(wide, small), low)


def test_embedding_does_not_change_the_function(rng):
    series = fs.analyze(rng.normal(size=(5, 5, 2)))
    np.testing.assert_allclose(fs.synthesize(fs.embed(series, 6), 13), fs.synthesize(series, 13),
                               atol=1e-13)


def test_cropping_removes_high_frequencies(band, rng):
    series = fs.analyze(rng.normal(size=(9, 9)))
    values = fs.synthesize(series, 9)
    low = band(2, 9)
    np.testing.assert_allclose(fs.crop(series, 2), low.series(values), atol=1e-13)


def test_symmetrize_is_the_nearest_real_function(rng):
    broken = rng.normal(size=(7, 4, 2)) + 1j * rng.normal(size=(7, 4, 2))
    healed = fs.symmetrize(broken)
    np.testing.assert_allclose(healed[::-1, 0], healed[:, 0].conj(), atol=1e-15)
    np.testing.assert_array_equal(healed[:, 1:], broken[:, 1:])
    np.testing.assert_allclose(fs.symmetrize(healed), healed, atol=1e-15)
    # What was taken away is orthogonal to every symmetric column.
    gap = (broken - healed)[:, 0]
    np.testing.assert_allclose(gap, -gap[::-1].conj(), atol=1e-15)


def test_symmetrize_keeps_real_functions(rng):
    series = fs.analyze(rng.normal(size=(9, 9, 3)))
    np.testing.assert_allclose(fs.symmetrize(series), series, atol=1e-15)
