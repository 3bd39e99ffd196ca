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

"""Filters of several blocks: joint or one by one, first frame and later ones."""

from dataclasses import replace

import numpy as np
import pytest

from lmsco_ros.core.config import LearningConfig
from lmsco_ros.core.fourier.series import analyze, synthesize
from lmsco_ros.core.learning.structured_operator import StructuredOperator

TARGET = (0.25, 0.3)
CONFIG = LearningConfig(
    margin_weight=1.0, label_sigma=0.25,
    window_minimum=0.03, window_edge=0.05, memory_size=4, learning_rate=0.1,
    initial_iterations=15, iterations=4, gradient_steps=2)


def make_sample(rng):
    """Return two blocks of unequal resolution."""
    return [analyze(rng.normal(size=(11, 11, 3))), analyze(rng.normal(size=(7, 7, 2)))]


def score_map(operator, sample):
    """Return the scores of one sample on a grid."""
    return synthesize(operator.scores([block[:, :, None, :] for block in sample]), 11)[:, :, 0]


@pytest.mark.parametrize('loss', ['unit', 'coupled', 'ridge'])
def test_target_scores_highest_at_the_origin(backend, rng, loss):
    sample = make_sample(rng)
    operator = StructuredOperator(replace(CONFIG, loss=loss), sample, TARGET, backend)
    scores = score_map(operator, sample)
    assert np.argmax(scores) == 0
    assert scores[0, 0] > 2 * np.abs(scores[4:7, 4:7]).max()


def test_filters_of_all_blocks_fit_together(backend, rng):
    # Each of the blocks alone reaches for the whole label; beside each other they would overshoot.
    sample = make_sample(rng)
    operator = StructuredOperator(replace(CONFIG, margin_weight=20.0), sample, TARGET, backend)
    assert abs(score_map(operator, sample)[0, 0] - 1) < 0.15


def test_training_takes_in_what_was_remembered(backend, rng):
    first, second = make_sample(rng), make_sample(rng)
    operator = StructuredOperator(CONFIG, first, TARGET, backend)
    before = [block.copy() for block in operator.filters]
    operator.remember(second)
    for block, old in zip(operator.filters, before, strict=True):
        np.testing.assert_array_equal(block, old)
    unseen = score_map(operator, second)[0, 0]
    for _ in range(5):
        operator.train()
    assert abs(score_map(operator, second)[0, 0] - 1) < 0.5 * abs(unseen - 1)


def test_training_lowers_the_objective(backend, rng):
    operator = StructuredOperator(CONFIG, make_sample(rng), TARGET, backend)
    for _ in range(6):
        operator.remember(make_sample(rng))
        before = operator.objective()
        operator.train()
        assert operator.objective() < before


def test_samples_are_not_changed(backend, rng):
    sample, later = make_sample(rng), make_sample(rng)
    kept = [block.copy() for block in [*sample, *later]]
    operator = StructuredOperator(CONFIG, sample, TARGET, backend)
    operator.remember(later)
    operator.train()
    for block, before in zip([*sample, *later], kept, strict=True):
        np.testing.assert_array_equal(block, before)


def test_scores_of_several_samples(backend, rng):
    samples = [make_sample(rng) for _ in range(3)]
    operator = StructuredOperator(CONFIG, samples[0], TARGET, backend)
    stacked = [np.stack(blocks, axis=2) for blocks in zip(*samples, strict=True)]
    scores = synthesize(operator.scores(stacked), 11)
    for j, sample in enumerate(samples):
        np.testing.assert_allclose(scores[:, :, j], score_map(operator, sample), atol=1e-12)


def silent(sample):
    """Return the sample with nothing to see in its second block."""
    return [sample[0], 0 * sample[1]]


def test_a_block_that_shows_something_for_the_first_time_is_learned_at_once(backend, rng):
    """By as many steps as the first frame, and only the first time."""
    first, second, third = (make_sample(rng) for _ in range(3))
    operator = StructuredOperator(CONFIG, silent(first), TARGET, backend)
    operator.remember(silent(second))
    assert not operator.filters[1].any()
    operator.remember(third)
    assert operator.filters[1].any()
    reached = operator.objective()
    before = [block.copy() for block in operator.filters]
    operator.remember(make_sample(rng))
    for block, old in zip(operator.filters, before, strict=True):
        np.testing.assert_array_equal(block, old)
    # The few steps of an update would not have got there.
    converged = StructuredOperator(CONFIG, silent(first), TARGET, backend)
    for sample in (silent(second), third):
        converged.remember(sample)
    for _ in range(40):
        converged.train()
    assert reached < 1.01 * converged.objective()
