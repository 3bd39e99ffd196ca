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

"""What a frame costs: whose it is, and what is told."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import lost_frames
from benchmarks.lost_frames import costs, table
from lmsco_ros.core import TrackState
from lmsco_ros.evaluation.datasets import TrackingSequence

TRACKING, UNCERTAIN, LOST = TrackState.TRACKING, TrackState.UNCERTAIN, TrackState.LOST


class Frames(list):
    """Frames that are their numbers."""

    signature = 'numbers'


def test_only_frames_whose_state_was_that_before_count(monkeypatch):
    """The first two frames are without the target; each frame takes as long as its number."""
    states = [TRACKING, TRACKING, TRACKING, UNCERTAIN, LOST, LOST, TRACKING]
    now = [0.0]

    class Told:
        """Says what was planned."""

        def initialize(self, image, box):
            assert image == 2 and box.as_tuple() == (10, 10, 5, 5)
            return SimpleNamespace(state=states[0])

        def update(self, image):
            now[0] += image
            return SimpleNamespace(state=states[image - 2])

    monkeypatch.setattr(lost_frames, 'LMSCOTracker', Told)
    monkeypatch.setattr(lost_frames.time, 'process_time', lambda: now[0])
    truth = np.array([[np.nan] * 4] * 2 + [[10, 10, 5, 5]] * 7, float)
    sequence = TrackingSequence('one', 'group', Frames(range(9)), truth)
    assert list(costs(sequence)) == [(TRACKING, 3), (TRACKING, 4), (LOST, 7)]


def test_searched_frames_stand_beside_those_that_are_followed():
    rows = table([(TRACKING, 0.002), (TRACKING, 0.004), (LOST, 0.0045)]).splitlines()[2:]
    assert rows == ['| followed | 2 | 3.00 | 3.00 | 3.98 | 1.00 |',
                    '| searched | 1 | 4.50 | 4.50 | 4.50 | 1.50 |']
    with pytest.raises(SystemExit, match='no frame is searched; choose'):
        table([(TRACKING, 0.002)])
