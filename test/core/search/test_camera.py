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

"""What the camera does, against pictures that were moved by known ways."""

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.imaging.gain import survey
from lmsco_ros.core.search.camera import background_motion, CameraMotion

INTENSITY = TrackerConfig.preset('default').intensity
VIEW = (240, 320)
ways = st.floats(-6, 6)


def landscape(seed=0):
    """Return ground with a texture, larger than a view of it."""
    rng = np.random.default_rng(seed)
    ground = cv2.GaussianBlur(rng.normal(0, 1, (480, 640)), (0, 0), 4)
    return (8000 + 100 * ground / ground.std()).astype(np.float32)


GROUND = landscape()


def shown(x, y, ground=GROUND):
    """Return what a camera shows that has moved the picture by (x, y) pixels."""
    moved = cv2.warpAffine(ground, np.array([[1, 0, x - 160], [0, 1, y - 120.0]]), VIEW[::-1],
                           flags=cv2.INTER_LINEAR)
    return moved.astype(np.uint16)


def levels(picture):
    """Return a picture in gray levels."""
    counts = picture.astype(np.float32)
    return cv2.normalize(counts, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def panned(camera, places, followed, moments=None):
    """Return what a camera says last that has shown these places in turn."""
    moments = range(len(places)) if moments is None else moments
    for place, seen, moment in zip(places, followed, moments, strict=True):
        said = camera.observe(survey(shown(*place), INTENSITY), moment, followed=seen)
    return said


@given(ways, ways)
def test_motion_is_that_of_the_picture(x, y):
    way = background_motion(levels(shown(0, 0)), levels(shown(x, y)))
    assert way == pytest.approx((x, y), abs=0.15)


def test_what_moves_before_the_background_does_not_count():
    camera = CameraMotion()
    for moment, (left, place) in enumerate(((100, (0, 0)), (90, (0, 0)), (80, (3, 1)))):
        image = shown(*place)
        image[100:140, left:left + 40] = 8600
        said = camera.observe(survey(image, INTENSITY), moment, followed=moment < 2)
    assert said == pytest.approx((3, 1), abs=0.3)


@pytest.mark.parametrize('before, now', [
    (np.full(VIEW, 90, np.uint8), np.full(VIEW, 90, np.uint8)),
    (levels(shown(0, 0)), levels(shown(3, 1))[::2]),
    (levels(shown(0, 0)), np.full(VIEW, 90, np.uint8)),
    (levels(shown(0, 0)), levels(shown(0, 0, landscape(1))))])
def test_nothing_is_said_where_the_background_tells_nothing(before, now):
    assert background_motion(before, now) is None


def test_nothing_is_said_while_the_target_is_followed():
    assert panned(CameraMotion(), [(0, 0), (3, 0), (6, 0)], 3 * [True]) == pytest.approx((0, 0))


@pytest.mark.parametrize('usual, then', [((2, 1), (2, 1)), ((2, 1), (0, 0)), ((0, 0), (-3, 2))])
def test_motion_is_told_beyond_the_usual_one(usual, then):
    usual, then = np.array(usual), np.array(then)
    places = [*(n * usual for n in range(12)), *(11 * usual + n * then for n in (1, 2, 3))]
    said = panned(CameraMotion(), places, 12 * [True] + 3 * [False])
    assert said == pytest.approx(then - usual, abs=0.3)


def test_usual_motion_is_that_of_the_last_ten_frames():
    places = [*((5 * n, 0) for n in range(8)), *12 * [(35, 0)], (37, 1)]
    said = panned(CameraMotion(), places, 20 * [True] + [False])
    assert said == pytest.approx((2, 1), abs=0.3)


def test_frames_that_were_left_out_count():
    places = [*((2 * n, 0) for n in range(8)), (24, 0)]
    said = panned(CameraMotion(), places, 8 * [True] + [False], [*range(8), 12])
    assert said == pytest.approx((0, 0), abs=0.3)


def test_usual_motion_is_measured_anew_for_the_next_loss():
    camera = CameraMotion()
    panned(camera, [(0, 0), (2, 0), (4, 0)], [True, True, False])
    at_rest = 12 * [(4, 0)]
    said = panned(camera, [*at_rest, (6, 0)], 12 * [True] + [False], range(3, 16))
    assert said == pytest.approx((2, 0), abs=0.3)


def test_another_view_has_nothing_to_do_with_the_one_before():
    camera = CameraMotion()
    panned(camera, [(3 * n, 0) for n in range(8)], 8 * [True])
    camera.forget()
    assert panned(camera, [(40, 20), (42, 20)], 2 * [False]) == pytest.approx((2, 0), abs=0.3)


def test_frames_that_show_nothing_are_left_out():
    camera = CameraMotion()
    panned(camera, [(0, 0), (2, 0), (4, 0)], 3 * [True])
    blank = survey(np.full(VIEW, 8000, np.uint16), INTENSITY)
    assert camera.observe(blank, 3, followed=False) == pytest.approx((0, 0))
    said = camera.observe(survey(shown(4, 0), INTENSITY), 4, followed=False)
    assert said == pytest.approx((-4, 0), abs=0.3)


def test_camera_is_taken_to_go_on_where_the_background_tells_nothing():
    camera = CameraMotion()
    panned(camera, [(2 * n, 0) for n in range(8)], 8 * [True])
    other = survey(shown(0, 0, landscape(1)), INTENSITY)
    assert camera.observe(other, 8, followed=False) == pytest.approx((0, 0))
