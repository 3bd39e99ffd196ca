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

from lmsco_ros.evaluation.geometry import overlaps
from lmsco_ros.evaluation.protocols.confidence import (
    auroc, auroc_terms, lost_figures, return_figures)
from lmsco_ros.evaluation.trace import Trace


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
    assert (figures.false_alarms, figures.recovered) == (1, 1)
    assert figures.lost_while_present == 3


@pytest.mark.parametrize('frames, recovered', [(29, 1), (30, 0)])
def test_target_is_found_again_within_thirty_frames_of_a_false_alarm(frames, recovered):
    lost = np.array([False] * 3 + [True] * frames + [False] * 5)
    assert lost_figures(lost, np.full(len(lost), .9)).recovered == recovered
    # A box that is not on the target is not found.
    assert lost_figures(lost, np.r_[.9, .9, .9, np.full(len(lost) - 3, .4)]).recovered == 0


def returning(truth, boxes, lost=(), starts=(0,)):
    """Return the figures of answers, given as x of boxes of 10 pixels, NaN for none."""
    def rows(values):
        values = np.asarray(values, dtype=float)
        return np.where(np.isfinite(values)[:, None],
                        np.stack([values, *[np.full(len(values), 10.)] * 3], axis=1), np.nan)
    ground_truth, answers = rows(truth), rows(boxes)
    marks = np.zeros(len(truth), bool)
    marks[list(lost)] = True
    trace = Trace(answers, np.full(len(truth), np.nan), marks, starts)
    return return_figures(ground_truth, trace, overlaps(ground_truth, answers))


def test_a_target_is_found_again_when_the_box_is_right_and_not_lost():
    truth = [0] * 5 + [np.nan] * 4 + [0] * 30
    # Claimed in two of four absent frames; right box from frame 9 on, believed from 12 on.
    figures = returning(truth, [0] * 39, lost=range(7, 12))
    assert (figures.absent, figures.claimed) == (4, 2)
    assert figures.delays == (3,)
    assert figures.mistaken == 0


def test_claims_elsewhere_count_until_the_target_is_found():
    truth = [0] * 5 + [np.nan] * 5 + [0] * 40
    elsewhere = [0] * 10 + [50] * 6 + [0] * 34
    figures = returning(truth, elsewhere)
    assert figures.delays == (6,) and figures.mistaken == 1
    # In LOST nothing is claimed, and a box that is half right is not elsewhere.
    assert returning(truth, elsewhere, lost=range(8, 16)).mistaken == 0
    assert returning(truth, [0] * 10 + [7] * 6 + [0] * 34).mistaken == 0
    # Claims after that are a new mistake, not one of the return.
    late = returning(truth, [0] * 11 + [50] * 39)
    assert late.delays == (0,) and late.mistaken == 0
    # No box is no claim.
    silent = returning(truth, [0] * 5 + [np.nan] * 45)
    assert silent.delays == (None,) and (silent.claimed, silent.mistaken) == (0, 0)


def test_a_return_has_thirty_frames():
    truth = [0] * 5 + [np.nan] * 5 + [0] * 40
    assert returning(truth, [0] * 5 + [50] * 34 + [0] * 11).delays == (29,)
    assert returning(truth, [0] * 5 + [50] * 35 + [0] * 10).delays == (None,)
    # Shorter ones are nobody's fault.
    assert returning(truth[:39], [50] * 39).delays == ()
    twice = [0] * 5 + [np.nan, 0] * 5 + [np.nan] + [0] * 30
    assert returning(twice, [0] * len(twice)).delays == (0,)


def test_a_jump_is_a_return_and_flying_is_none():
    flying = np.arange(80) * 15.
    assert returning(flying, flying).delays == ()
    jumping = np.r_[np.zeros(40), np.full(40, 21.)]
    figures = returning(jumping, np.r_[np.zeros(44), np.full(36, 21.)])
    assert figures.delays == (4,) and figures.mistaken == 1
    assert figures.absent == figures.claimed == 0


def test_nothing_counts_before_the_start():
    truth = [np.nan] * 6 + [0] * 40
    figures = returning(truth, [np.nan] * 6 + [0] * 40, starts=(6,))
    assert (figures.absent, figures.claimed, figures.delays) == (0, 0, ())
