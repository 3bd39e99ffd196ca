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

"""Confidence intervals behave as intervals of a mean over sequences should."""

import math

import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.bootstrap import (
    mean_estimate, paired_difference, ratio_estimate, resampled_weights)


def test_resamples_draw_as_many_sequences_as_there_are():
    weights = resampled_weights(7, resamples=50)
    assert weights.shape == (50, 7)
    assert (weights.sum(axis=1) == 7).all()
    assert (weights == resampled_weights(7, resamples=50)).all()


def test_interval_matches_the_normal_one_for_many_values():
    values = np.random.default_rng(1).normal(0.6, 0.2, 400)
    result = mean_estimate(values)
    half = 1.96 * values.std() / math.sqrt(400)
    assert result.value == pytest.approx(values.mean())
    assert result.low == pytest.approx(values.mean() - half, abs=half / 5)
    assert result.high == pytest.approx(values.mean() + half, abs=half / 5)


def test_equal_values_leave_no_doubt_and_no_values_no_figure():
    same = mean_estimate(np.full(5, .3))
    assert (same.value, same.low, same.high) == pytest.approx((.3, .3, .3))
    assert math.isnan(mean_estimate(np.array([np.nan])).value)
    assert mean_estimate(np.array([.2, np.nan, .4])).value == pytest.approx(.3)


def test_ratio_weighs_sequences_by_their_denominator():
    speed = ratio_estimate(np.array([10., 300]), np.array([1., 10]))
    assert speed.value == pytest.approx(310 / 11)


def test_pairing_sees_a_small_difference_that_unpaired_intervals_hide():
    hardness = np.linspace(0, 1, 20)
    better = paired_difference(hardness + .01, hardness)
    assert better.low > 0
    assert better.value == pytest.approx(.01)
