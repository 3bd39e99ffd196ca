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

"""Reliability of scores against values counted by hand and by a loop."""

import math

from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.calibration import BINS, calibration_error, calibration_terms

share = st.floats(0, 1)


def error(scores, overlap, weights=None):
    """Return the calibration error over some sequences."""
    terms = calibration_terms([np.array(score) for score in scores],
                              [np.array(value) for value in overlap])
    return calibration_error(terms, np.ones(len(scores)) if weights is None else weights)


def test_error_is_the_distance_of_score_and_share_over_the_bins():
    # .92 and .96: one of two is good. .41: good. .05: bad.
    assert error([[.92, .96, .41, .05]], [[.9, .1, .6, .2]]) == pytest.approx(
        (2 * abs(.94 - .5) + abs(.41 - 1) + .05) / 4)


def test_overlap_of_one_half_is_not_good_and_no_target_is_none():
    assert error([[1.0]], [[.5]]) == 1
    assert error([[.8]], [[np.nan]]) == pytest.approx(.8)
    assert error([[np.nan, 1.0]], [[.1, .9]]) == 0


def test_sequences_can_be_weighed():
    scores, overlap = [[.9], [.2]], [[1.0], [1.0]]
    assert error(scores, overlap) == pytest.approx((.1 + .8) / 2)
    np.testing.assert_allclose(error(scores, overlap, np.array([[1., 0], [0, 1], [3, 1]])),
                               [.1, .8, (.3 + .8) / 4])


@pytest.mark.parametrize('scores', [[[-.1, .5]], [[.5, 1.5]], [[np.nan]], [[]]])
def test_what_is_no_probability_is_not_judged(scores):
    assert math.isnan(error(scores, [np.full(len(scores[0]), .9)]))


def test_reliability_is_that_of_the_bins():
    terms = calibration_terms([np.array([.95, 1.0, .1])], [np.array([.9, .9, .1])])
    assert terms.frames.tolist() == [0, 1] + [0] * 7 + [2]
    assert terms.mean_scores[-1] == pytest.approx(.975) and math.isnan(terms.mean_scores[4])
    assert terms.shares[[1, 9]].tolist() == [0, 1]


@given(values=arrays(float, st.tuples(st.integers(1, 40), st.just(2)), elements=share))
def test_error_is_that_of_a_loop(values):
    total = 0.0
    for index in range(BINS):
        low, high = index / BINS, (index + 1) / BINS
        rows = [(score, overlap > .5) for score, overlap in values
                if int(BINS * score) == index or (index == BINS - 1 and score == high)
                and score >= low]
        if rows:
            scores, good = zip(*rows)
            total += len(rows) * abs(np.mean(scores) - np.mean(good))
    assert error([values[:, 0]], [values[:, 1]]) == pytest.approx(total / len(values))
