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

"""What is said after a start, counted on short runs."""

import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.starts import start_outcomes, StartOutcome
from lmsco_ros.evaluation.trace import Trace

BOX = np.array([10., 10, 10, 10])


def outcomes(frames=40, present=True, scores=0.9, lost=(), gone=(), starts=(0,)):
    """Return the outcomes of a tracker that stays where it is."""
    truth, boxes = np.tile(BOX, (frames, 1)), np.tile(BOX, (frames, 1))
    truth[1:] = BOX if present else np.nan
    boxes[list(gone)] = np.nan
    marks = np.zeros(frames, bool)
    marks[list(lost)] = True
    trace = Trace(boxes, np.broadcast_to(scores, frames).astype(float), marks, starts)
    return list(start_outcomes(truth, trace))


@pytest.mark.parametrize('present', [True, False])
def test_quiet_start_is_a_claim(present):
    assert outcomes(present=present) == [StartOutcome(not present, told=False, lost=False)]


@pytest.mark.parametrize('changes, told, lost', [
    ({'scores': .49}, True, False),
    ({'scores': np.r_[np.full(15, .9), np.full(25, .1)]}, True, False),
    ({'scores': np.r_[np.full(17, .9), np.full(23, .1)]}, False, False),
    ({'lost': [30]}, False, True),
    ({'lost': [31]}, False, False),
    ({'lost': [0]}, False, False),
    ({'lost': range(10, 31)}, True, True),
    ({'gone': range(10, 31)}, True, True),
    ({'scores': np.nan}, False, False)])
def test_low_scores_and_lost_tell(changes, told, lost):
    assert outcomes(present=False, **changes) == [StartOutcome(True, told, lost)]


def test_too_few_frames_are_not_judged():
    assert outcomes(frames=30) == [] and len(outcomes(frames=31)) == 1
    assert len(outcomes(frames=80, starts=(0, 20))) == 1
    assert len(outcomes(frames=80, starts=(0, 40))) == 2


def test_target_that_leaves_soon_is_neither():
    truth = np.tile(BOX, (40, 1))
    truth[20:] = np.nan
    trace = Trace(np.tile(BOX, (40, 1)), np.ones(40), np.zeros(40, bool), (0,))
    assert list(start_outcomes(truth, trace)) == []
