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

"""Where a target is expected, and how large."""

import numpy as np
import pytest

from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.search.course import Course
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState

IMAGE = (200, 100)


def vanishing(widths):
    """Return the course of a target at rest whose visible part has had these widths."""
    course = Course(BoundingBox.from_center((50, 40), (widths[0], 30)), None)
    for width in widths[1:]:
        course.follow(BoundingBox.from_center((50, 40), (width, 30)))
    return course


def test_missed_target_is_expected_as_it_was_seen_last():
    course = vanishing([20, 12, 5])
    course.missed(None)
    assert course.expected(IMAGE).size == pytest.approx((5, 30))


def test_lost_target_is_expected_in_the_size_before_it_vanished():
    course = vanishing([20, 21, 12, 5])
    course.missed(None)
    course.lost()
    assert course.expected(IMAGE).size == pytest.approx((21, 30))
    assert course.expected(IMAGE).center == pytest.approx((50, 40))


def test_target_that_has_become_small_is_expected_small():
    course = vanishing([40, 20] + 30 * [19])
    course.lost()
    assert course.expected(IMAGE).size == pytest.approx((19, 30))


def test_lost_target_is_expected_in_a_size_of_thirty_frames_ago():
    course = vanishing([40, 20] + 29 * [19])
    course.lost()
    assert course.expected(IMAGE).size == pytest.approx((20, 30))


def test_lost_target_that_is_found_is_expected_as_it_is_found():
    course = vanishing([20, 5])
    course.lost()
    course.follow(BoundingBox.from_center((90, 40), (18, 30)))
    assert course.expected(IMAGE).size == pytest.approx((18, 30))


class Turning:
    """A camera whose view moves by (4, -2) more than before in each frame without the target."""

    def __init__(self):
        self.asked = []

    def observe(self, frame, moment, *, followed):
        self.asked.append((frame, moment, followed))
        return np.zeros(2) if followed else np.array([4.0, -2.0])


def test_target_that_is_not_seen_goes_with_the_view():
    course = vanishing([20, 20])
    course._camera = camera = Turning()
    before = course.predicted.center
    course.next_frame(None)
    course.look_around('seen')
    assert course.last.center == (50, 40) and course.predicted.center == before
    course.missed(BoundingBox.from_center((53, 41), (20, 30)))
    course.next_frame(None)
    course.look_around('hidden')
    assert course.last.center == pytest.approx((54, 38))
    assert course.predicted.center == pytest.approx((54, 38))
    # The place that may have shown it has moved, too.
    assert course.expected(IMAGE).center == pytest.approx((57, 39))
    assert camera.asked == [('seen', 1, True), ('hidden', 2, False)]
    course.missed(None)
    assert course.expected(IMAGE).center == pytest.approx((54, 38))


def test_camera_is_told_how_many_frames_have_passed():
    course = Course(BoundingBox(40, 25, 20, 30), 7.0)
    course._camera = camera = Turning()
    for time in (7 + 1 / 30, 7 + 4 / 30):
        course.next_frame(time)
        course.look_around('seen')
    assert [moment for _, moment, _ in camera.asked] == pytest.approx([1, 4])


def told(measured):
    """Return the covariance of a box at rest that was measured so."""
    course, box = Course(BoundingBox(40, 25, 20, 30), None), BoundingBox(40, 25, 20, 30)
    course.next_frame(None)
    course.measure(box, 0.01 * np.eye(4), measured)
    said = TrackResult(box, 1.0, TrackState.TRACKING, np.zeros((4, 4), np.float32), box)
    return course.describe(said, IMAGE).covariance


def test_what_is_told_is_as_unsure_as_the_edges_along_either_axis():
    edges = np.array([[40.0, 60.0], [25.0, 55.0]])
    covariance = told(Measurement(edges, np.array([[1.0, 3.0], [5.0, 5.0]]), 3.0))
    # Eight tenths of the mean deviation of both edges, and as good as nothing beside that.
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.8 * 2, abs=0.05)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(0.8 * 5, abs=0.05)
    assert np.sqrt(told(None)[0, 0]) == pytest.approx(0.055 * 20, abs=0.05)
