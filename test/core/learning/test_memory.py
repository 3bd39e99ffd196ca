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

"""Sample memory: weights, and the score operator against sums in space."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.fourier.series import analyze, inner, synthesize
from lmsco_ros.core.learning.memory import PriorWeights, SampleMemory, score

SHAPES = [(9, 5, 2), (5, 3, 3)]


def sample_of(rng, shapes=SHAPES):
    """Return the series of a random sample."""
    return [analyze(rng.normal(size=(shape[0], shape[0], shape[2]))) for shape in shapes]


def filled(backend, rng, count, capacity=4, rate=0.1):
    """Return a memory and all samples that were put into it."""
    memory = SampleMemory(capacity, rate, SHAPES, backend)
    samples = [sample_of(rng) for _ in range(count)]
    for sample in samples:
        memory.add(sample)
    return memory, samples


@given(rate=st.floats(0, 0.5), capacity=st.integers(1, 6), count=st.integers(1, 15))
def test_weights_follow_the_law(rate, capacity, count):
    prior = PriorWeights(capacity, rate)
    history = np.zeros(0)
    newest = None
    for _ in range(count):
        slot = prior.take_slot()
        if len(history) < capacity:
            assert slot == len(history)
            history = np.append(history, 0.0)
        else:
            assert history[slot] == history.min()
        history[slot] = 1.0 if newest is None or capacity == 1 else history[newest] / (1 - rate)
        history = history / history.sum()
        newest = slot
        np.testing.assert_allclose(prior.values, history, rtol=1e-9)
        assert len(prior) == len(history)
    assert prior.values.sum() == pytest.approx(1)


def test_second_sample_counts_more_than_the_first():
    prior = PriorWeights(3, 0.2)
    prior.take_slot()
    prior.take_slot()
    assert prior.values[1] / prior.values[0] == pytest.approx(1 / 0.8)


def test_full_memory_gives_up_its_least_important_sample(backend, rng):
    memory, samples = filled(backend, rng, 3, capacity=3)
    newest = sample_of(rng)
    assert memory.add(newest) == 0
    assert len(memory) == 3
    for block, kept in zip(memory.blocks, zip(newest, *samples[1:], strict=True), strict=True):
        np.testing.assert_array_equal(block, np.stack(kept, axis=2))


def test_memory_of_one_holds_the_newest(backend, rng):
    memory, samples = filled(backend, rng, 3, capacity=1)
    assert memory.weights.tolist() == [1.0]
    np.testing.assert_array_equal(memory.blocks[0][:, :, 0], samples[-1][0])


def test_bandwidth_is_the_largest(backend):
    memory = SampleMemory(2, 0.1, SHAPES, backend)
    assert memory.order == 4 and len(memory) == 0


def test_scores_are_convolutions_in_space(backend, band, rng):
    memory, samples = filled(backend, rng, 3)
    filters = sample_of(rng)
    values = synthesize(memory.forward(filters), 9)
    # Every function on the same grid, convolved by its definition: mean_u z(t - u) w(u).
    for j, sample in enumerate(samples):
        expected = np.zeros((9, 9))
        for order, z, w in zip((4, 2), sample, filters, strict=True):
            feature, weight = band(order, 9).values(z), band(order, 9).values(w)
            for uy in range(9):
                for ux in range(9):
                    moved = np.roll(feature, (uy, ux), axis=(0, 1))
                    expected += np.sum(moved * weight[uy, ux], axis=-1) / 81
        np.testing.assert_allclose(values[:, :, j], expected, atol=1e-12)


def test_score_takes_scales_like_samples(rng):
    blocks = [np.stack([sample_of(rng)[i] for _ in range(3)], axis=2) for i in range(2)]
    filters = sample_of(rng)
    result = score(blocks, filters)
    assert result.shape == (9, 5, 3)
    for j in range(3):
        single = score([b[:, :, j:j + 1] for b in blocks], filters)
        np.testing.assert_allclose(result[:, :, j], single[:, :, 0], atol=1e-14)


@pytest.mark.parametrize('count', [1, 3, 6])
def test_adjoint_passes_the_dot_test(backend, rng, count):
    memory, _ = filled(backend, rng, count)
    filters = sample_of(rng)
    residual = analyze(rng.normal(size=(9, 9, len(memory))))
    left = float(np.sum(memory.weights * inner(memory.forward(filters), residual)))
    right = sum(float(np.sum(inner(w, r)))
                for w, r in zip(filters, memory.adjoint(residual), strict=True))
    assert left == pytest.approx(right, rel=1e-12)


def test_adjoint_gives_real_functions(backend, rng):
    memory, _ = filled(backend, rng, 2)
    for block in memory.adjoint(analyze(rng.normal(size=(9, 9, 2)))):
        np.testing.assert_allclose(block[::-1, 0], block[:, 0].conj(), atol=1e-14)


def test_running_averages_are_the_weighted_ones_until_the_memory_is_full(backend, rng):
    memory, samples = filled(backend, rng, 4)
    weights = memory.weights
    for i in range(2):
        stacked = np.stack([sample[i] for sample in samples])
        np.testing.assert_allclose(memory.mean[i], np.tensordot(weights, stacked, axes=1),
                                   atol=1e-12)
        np.testing.assert_allclose(memory.energy[i], np.tensordot(
            weights, np.abs(stacked)**2, axes=1), atol=1e-12)


def test_running_averages_go_on_with_the_weight_of_the_newest(backend, rng):
    memory, _ = filled(backend, rng, 6)
    mean, energy = memory.mean[0].copy(), memory.energy[0].copy()
    newest = sample_of(rng)
    slot = memory.add(newest)
    weight = memory.weights[slot]
    np.testing.assert_allclose(memory.mean[0], (1 - weight) * mean + weight * newest[0],
                               atol=1e-12)
    np.testing.assert_allclose(
        memory.energy[0], (1 - weight) * energy + weight * np.abs(newest[0])**2, atol=1e-12)
