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


@pytest.mark.parametrize('jump, asked', [(19.9, 0), (20.0, 1)])
def test_move_by_the_side_of_the_target_is_a_jump(distractors, scenery, jump, asked):
    distractors.explain((100.0 + jump, 100.0), BOX, scenery.resembles)
    assert scenery.asked == asked


def test_step_away_from_the_kept_place_is_no_jump(distractors, scenery):
    """The target has come a long way since the frame was kept."""
    moved = BOX.moved_to((100.0, 160.0))
    assert not distractors.explain((115.0, 160.0), moved, scenery.resembles)
    assert scenery.asked == 0


@pytest.mark.parametrize('distance, asked', [(19.9, 0), (20.0, 1)])
def test_place_of_the_target_itself_in_the_kept_frame_says_nothing(
        distractors, scenery, distance, asked):
    """The target has moved away since, and something is found where it was."""
    moved = BOX.moved_to((100.0, 160.0))
    distractors.explain((100.0 - distance, 100.0), moved, scenery.resembles)
    assert scenery.asked == asked


@pytest.mark.parametrize('step, known', [(14.9, True), (15.1, False)])
def test_distractor_takes_three_quarters_of_the_targets_side_in_a_frame(
        distractors, scenery, step, known):
    distractors.explain(TWIN, BOX, scenery.resembles)
    assert distractors.explain((TWIN[0] + step, TWIN[1]), BOX, scenery.resembles) is known


def test_nearest_of_two_distractors_is_followed():
    scenery, distractors = Scenery(), Distractors()
    twins = [(150.0, 100.0), (165.0, 100.0)]
    distractors.certain(scenery.view(*twins), BOX)
    for twin in twins[::-1]:
        assert distractors.explain(twin, BOX, scenery.resembles)
    assert distractors.explain((154.0, 100.0), BOX, scenery.resembles)
    assert sorted(distractors.places) == [(154.0, 100.0), (165.0, 100.0)]


def test_what_is_as_near_as_the_target_is_the_target(distractors, scenery):
    """Half way between the two, nothing is told of a distractor."""
    distractors.explain(TWIN, BOX, scenery.resembles)
    beside = BOX.moved_to((140.0, 110.0))
    assert not distractors.explain((145.0, 110.0), beside, scenery.resembles)


def counted(distractors, frames):
    """Let frames pass."""
    for _ in range(frames):
        distractors.next_frame()


@pytest.mark.parametrize('frames, there', [(59, True), (60, False)])
def test_kept_frame_is_too_old_after_two_seconds(distractors, scenery, frames, there):
    counted(distractors, frames)
    assert distractors.explain(TWIN, BOX, scenery.resembles) is there


@pytest.mark.parametrize('frames, known', [(60, True), (61, False)])
def test_place_is_kept_for_two_seconds_however_the_target_is_followed(
        distractors, scenery, frames, known):
    distractors.explain(TWIN, BOX, scenery.resembles)
    distractors.certain(scenery.view(BOX.center), BOX)
    counted(distractors, frames)
    assert bool(distractors.places) is known


def test_new_place_is_as_new_as_the_frame_it_is_found_in(distractors, scenery):
    """Only the older of two places is forgotten."""
    distractors.certain(scenery.view(TWIN, (40.0, 180.0)), BOX)
    distractors.explain(TWIN, BOX, scenery.resembles)
    counted(distractors, 1)
    distractors.explain((40.0, 180.0), BOX, scenery.resembles)
    counted(distractors, 60)
    assert distractors.places == [(40.0, 180.0)]


@pytest.mark.parametrize('frames, newer', [(0, False), (1, False), (2, True)])
def test_large_frames_are_kept_now_and_then(scenery, frames, newer):
    """One of two megabytes is copied in every other frame."""
    large = np.zeros((1024, 2048), np.uint8)
    distractors = Distractors()
    distractors.certain(FrameView(large, IntensityRange(0, 1)), BOX)
    counted(distractors, frames)
    large[110, 150] = 1
    distractors.certain(FrameView(large, IntensityRange(0, 1)), BOX)
    assert distractors.explain(TWIN, BOX, scenery.resembles) is newer


def test_kept_frame_is_as_new_as_it_is(scenery):
    """What is counted begins anew with the frame, and so does the time until the next copy."""
    distractors = Distractors()
    view = scenery.view(BOX.center, TWIN)
    distractors.certain(view, BOX)
    counted(distractors, 40)
    distractors.certain(view, BOX)
    counted(distractors, 40)
    assert distractors.explain(TWIN, BOX, scenery.resembles)


def test_target_of_the_kept_frame_is_where_it_was_then(scenery):
    distractors = Distractors()
    distractors.certain(scenery.view(BOX.center), BOX)
    distractors.certain(scenery.view(TWIN, (20.0, 20.0)), BOX.moved_to(TWIN))
    # The twin was the target in the newer frame.
    assert not distractors.explain(TWIN, BOX, scenery.resembles)


def test_forgotten_frame_is_followed_by_any_other(distractors, scenery):
    distractors.forget()
    distractors.certain(scenery.view(TWIN), BOX)
    assert distractors.explain(TWIN, BOX, scenery.resembles)


def test_what_is_asked_about_has_the_size_of_the_target(distractors):
    asked = []
    distractors.explain(TWIN, BOX, lambda view, box: asked.append(box) or False)
    assert asked == [BOX.moved_to(TWIN)] and distractors.places == []
