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

"""Accuracy, robustness and expected overlap against hand-computed values."""

import math

import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.expected_overlap import (
    curve_terms, expected_average_overlap, expected_overlap_curve, longest_fragment)
from lmsco_ros.evaluation.protocols.per_attribute import attribute_figures
from lmsco_ros.evaluation.protocols.ranking import mean_ranks
from lmsco_ros.evaluation.protocols.supervised import (
    accuracy, counted_frames, Fragment, fragments, reliability)


def test_accuracy_leaves_out_burn_in_failure_and_gap():
    overlap = np.array([1, .9, .8, .7, 0, 0, 0, 0, 0, 1, .5, .3])
    starts, failures = (0, 9), (4,)
    # With a burn-in of 2: frames 2, 3 and 11.
    assert counted_frames(12, starts, failures, 2).nonzero()[0].tolist() == [2, 3, 11]
    assert accuracy(overlap, starts, failures, 2) == pytest.approx((.8 + .7 + .3) / 3)
    assert accuracy(overlap, starts, failures) == 0


def test_accuracy_leaves_out_absent_targets():
    overlap = np.array([1, .9, np.nan, .5])
    assert accuracy(overlap, (0,), (), 1) == pytest.approx(.7)


def test_reliability_is_the_chance_to_survive():
    assert reliability(0, 100) == 1
    assert reliability(2, 600) == pytest.approx(math.exp(-0.1))
    assert reliability(1, 100, sensitivity=100) == pytest.approx(math.exp(-1))


def test_fragments_run_from_start_to_failure_or_end():
    overlap = np.array([1, .9, .8, 0, 0, 0, 0, 0, 1, np.nan, .5])
    first, second = fragments(overlap, (0, 8), (3,))
    assert first.overlaps.tolist() == [1, .9, .8] and first.failed
    assert second.overlaps.tolist() == [1, .5] and not second.failed


def test_a_refused_start_is_an_empty_failed_fragment():
    (fragment,) = fragments(np.zeros(4), (2,), (2,))
    assert fragment.overlaps.size == 0 and fragment.failed


def test_expected_overlap_in_both_conventions_by_hand():
    parts = [Fragment(np.array([1, .8, .6]), failed=True), Fragment(np.array([1, .4]), False)]
    # N = 2: (.8 + .4) / 2. N = 3: only the failed one, (.8 + .6) / 2. Then zeros follow:
    # N = 4: 1.4 / 3, N = 5: 1.4 / 4.
    curve = expected_overlap_curve(*curve_terms(parts, 5))
    assert curve[1:] == pytest.approx([.6, .7, 1.4 / 3, 1.4 / 4])
    assert longest_fragment(parts) == 3
    python_curve = expected_overlap_curve(*curve_terms(parts, longest_fragment(parts)))
    assert python_curve[1:] == pytest.approx([.6, .7])
    assert expected_average_overlap(curve, (2, 4)) == pytest.approx((.6 + .7 + 1.4 / 3) / 3)
    # Beyond the tracker's longest fragment the Python convention forgets the zeros.
    assert expected_average_overlap(python_curve, (2, 4)) == pytest.approx(.65)


def test_curve_is_unknown_where_no_fragment_reaches():
    curve = expected_overlap_curve(*curve_terms([Fragment(np.ones(2), failed=False)], 4))
    assert curve[:2].tolist() == [1, 1] and np.isnan(curve[2:]).all()
    assert math.isnan(expected_average_overlap(curve, (3, 4)))


def test_terms_of_sequences_add_up():
    first, second = Fragment(np.array([1, .5]), True), Fragment(np.array([1, .9, .9]), False)
    together = curve_terms([first, second], 4)
    apart = [a + b for a, b in zip(curve_terms([first], 4), curve_terms([second], 4))]
    assert np.allclose(together, apart)


def test_ranks_share_ties():
    accuracies = np.array([[.9, .5], [.8, .5], [.1, .9]])
    assert mean_ranks(accuracies, True).tolist() == [(1 + 2.5) / 2, (2 + 2.5) / 2, (3 + 1) / 2]
    assert mean_ranks(np.array([[0], [3.]]), False).tolist() == [1, 2]


def test_attributes_pool_their_frames_and_failures():
    overlap = np.array([1, .5, .3, 0])
    counted = np.array([False, True, True, False])
    flags = {'occlusion': np.array([False, False, True, True]), 'empty': np.zeros(4, bool)}
    figures = attribute_figures(overlap, counted, [3], flags)
    assert figures['occlusion'].frames == 1
    assert figures['occlusion'].mean_overlap == pytest.approx(.3)
    assert figures['occlusion'].failures == 1
    assert figures['empty'].frames == 0 and math.isnan(figures['empty'].mean_overlap)
