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

"""Score and LOST declarations against hand-computed values."""

import math

import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.confidence import auroc, auroc_terms, lost_figures


def pooled(scores, overlap, weights=None):
    """Return the AUROC over some sequences."""
    terms = auroc_terms([np.array(score) for score in scores],
                        [np.array(value) for value in overlap])
    return auroc(*terms, np.ones(len(scores)) if weights is None else np.array(weights))


def test_auroc_counts_pairs_in_order():
    overlap = [[.9, .8, .1, .2, np.nan]]
    # Good frames score .9 and .4, bad ones .4 and .1: three pairs right, one tied.
    scores = [[.9, .4, .4, .1, 1]]
    assert pooled(scores, overlap) == pytest.approx(3.5 / 4)
    assert pooled([[-score for score in scores[0]]], overlap) == pytest.approx(0.5 / 4)


def test_auroc_pools_and_weighs_sequences():
    scores, overlap = [[.9, .3], [.5, .7, np.nan]], [[.9, .1], [.9, .1, .9]]
    # Good .9 and .5, bad .3 and .7: three of four pairs in order.
    assert pooled(scores, overlap) == pytest.approx(3 / 4)
    assert pooled(scores, overlap, [0, 1]) == 0
    # The first sequence twice: good .9 .9 .5, bad .3 .3 .7.
    assert pooled(scores, overlap, [2, 1]) == pytest.approx(8 / 9)


def test_auroc_is_unknown_without_both_kinds_or_without_scores():
    assert math.isnan(pooled([[.9, .8]], [[.9, .8]]))
    assert math.isnan(pooled([[np.nan, np.nan]], [[.9, .1]]))


def test_time_to_lost_after_each_absence():
    there, gone = .8, np.nan
    overlap = np.array([there, there, gone, gone, gone, there, gone, gone])
    lost = np.array([0, 0, 0, 0, 1, 0, 0, 0], bool)
    figures = lost_figures(lost, overlap)
    assert figures.delays == (2, None)
    assert figures.false_alarms == 0
    assert figures.frames_present == 3


def test_an_absence_at_the_very_start_is_nobodys_delay():
    assert lost_figures(np.zeros(3, bool), np.array([np.nan, .5, .5])).delays == ()


def test_lost_is_false_only_while_the_box_was_right():
    overlap = np.array([1, .9, .9, .9, .1, .1])
    lost = np.array([0, 1, 1, 0, 0, 1], bool)
    figures = lost_figures(lost, overlap)
    assert figures.false_alarms == 1
    assert figures.lost_while_present == 3
