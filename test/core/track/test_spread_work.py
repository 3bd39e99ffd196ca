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

"""A frame that trains leaves the comparison to the next one, unless there is doubt."""

from collections import Counter

import pytest

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackState
from lmsco_ros.core.detection.scale import ScaleFilter
from lmsco_ros.core.presence.comparison import Comparison

SIZE = (24.0, 18.0)
START = (60.3, 64.4)


@pytest.fixture
def done(monkeypatch):
    """Count what a frame does."""
    calls = Counter()

    def count(owner, name, stage):
        original = getattr(owner, name)

        def counted(*args, **kwargs):
            calls[stage] += 1
            return original(*args, **kwargs)

        monkeypatch.setattr(owner, name, counted)

    count(Comparison, '__call__', 'compared')
    count(ScaleFilter, 'estimate', 'scaled')
    count(ScaleFilter, 'learn', 'trained')
    return calls


def work(done, interval, frames):
    """Return what each frame after the first did, and the last result; nothing is searched."""
    tracker = LMSCOTracker(TrackerConfig.from_dict({
        'learning': {'update_interval': interval},
        'presence': {'distractors': False}, 'search': {'candidates': 0, 'tiles': 0}}))
    tracker.initialize(frames[0], BoundingBox.from_center(START, SIZE))
    works = []
    for image in frames[1:]:
        done.clear()
        result = tracker.update(image)
        works.append(dict(done))
    return works, result


@pytest.fixture
def resting(make_scene):
    scene = make_scene((240, 160))
    return [scene.frame(START, SIZE, pan=(n / 10, 0)) for n in range(9)]


def test_frames_take_turns(done, resting):
    works, result = work(done, 2, resting)
    assert works == 4 * [{'compared': 1, 'scaled': 1}, {'scaled': 1, 'trained': 1}]
    assert result.state is TrackState.TRACKING


def test_a_frame_that_always_trains_leaves_nothing_out(done, resting):
    works, _ = work(done, 1, resting)
    assert works == 8 * [{'compared': 1, 'scaled': 1, 'trained': 1}]


@pytest.mark.parametrize('last', [6, 7])
def test_doubt_is_settled_at_once(done, make_scene, resting, last):
    empty = make_scene((240, 160)).frame(None, SIZE)
    works, result = work(done, 2, resting[:last] + [empty])
    assert works[-1]['compared'] == 1
    assert result.state is not TrackState.TRACKING
