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

import pytest

from lmsco_ros.core.search.course import Course
from lmsco_ros.core.types import BoundingBox

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
