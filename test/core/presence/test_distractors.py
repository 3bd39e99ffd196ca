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

"""Memory of things that look like the target."""

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.presence.distractors import Distractors

SIZE = (320, 240)
BOX = BoundingBox.from_center((100, 100), (20, 20))
TWIN = (150.0, 110.0)


class Scenery:
    """Frames in which each lit pixel looks like a target within 5 pixels."""

    def __init__(self):
        self.asked = 0

    def view(self, *places):
        image = np.zeros(SIZE[::-1], np.uint8)
        for x, y in places:
            image[int(y), int(x)] = 1
        return FrameView(image, IntensityRange(0, 1))

    def resembles(self, view, box):
        self.asked += 1
        rows, columns = np.nonzero(view.image)
        return bool((np.hypot(columns - box.center[0], rows - box.center[1]) < 5).any())


@pytest.fixture
def scenery():
    return Scenery()


@pytest.fixture
def distractors(scenery):
    """Return a memory that has seen a target, with something like it beside."""
    result = Distractors()
    result.certain(scenery.view(BOX.center, TWIN), BOX)
    result.next_frame()
    return result


def test_what_was_there_before_is_a_distractor(distractors, scenery):
    assert distractors.explain(TWIN, BOX, scenery.resembles)
    assert distractors.places == [TWIN]


def test_what_was_not_there_may_be_the_target(distractors, scenery):
    assert not distractors.explain((40.0, 180.0), BOX, scenery.resembles)
    assert distractors.places == []


def test_target_that_moves_is_not_asked_about(distractors, scenery):
    for place in ((100.0, 100.0), (115.0, 105.0)):
        assert not distractors.explain(place, BOX, scenery.resembles)
    assert scenery.asked == 0


def test_frame_without_a_certain_target_says_nothing(scenery):
    assert not Distractors().explain(TWIN, BOX, scenery.resembles)


def test_distractor_is_followed_and_does_not_spread(distractors, scenery):
    distractors.explain(TWIN, BOX, scenery.resembles)
    place = TWIN
    for _ in range(8):
        place = (place[0] + 6, place[1] - 5)
        assert distractors.explain(place, BOX, scenery.resembles)
    assert distractors.places == [place]
    # Where it was at first, a target may be by now; it is not at the known place any more.
    assert not distractors.explain((60.0, 60.0), BOX, scenery.resembles)


def test_known_distractor_wins_near_the_target(distractors, scenery):
    distractors.explain(TWIN, BOX, scenery.resembles)
    beside = BOX.moved_to((134.0, 110.0))
    assert distractors.explain((148.0, 110.0), beside, scenery.resembles)
    assert not distractors.explain((137.0, 110.0), beside, scenery.resembles)


def test_distractor_is_forgotten_after_two_seconds(distractors, scenery):
    distractors.explain(TWIN, BOX, scenery.resembles)
    for _ in range(60):
        assert distractors.explain(TWIN, BOX, scenery.resembles)
        distractors.next_frame()
    distractors.next_frame()
    assert distractors.places == [] and not distractors.explain(TWIN, BOX, scenery.resembles)


def test_another_view_has_no_distractors_yet(distractors, scenery):
    assert distractors.explain(TWIN, BOX, scenery.resembles)
    distractors.forget()
    assert distractors.places == []
    assert not distractors.explain(TWIN, BOX, scenery.resembles)


def test_kept_frame_is_a_copy(scenery):
    view, distractors = scenery.view(BOX.center, TWIN), Distractors()
    distractors.certain(view, BOX)
    view.image[:] = 0
    assert distractors.explain(TWIN, BOX, scenery.resembles)
