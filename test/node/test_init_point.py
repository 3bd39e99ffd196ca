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

"""Starts on a point over real ROS messages: where, on which frame, and what is answered."""

import math

from geometry_msgs.msg import PointStamped
import pytest
from std_srvs.srv import SetBool

from lmsco_ros.core.errors import PointError
from lmsco_ros.core.types import BoundingBox


class Clicking:
    """A node with a viewer in which somebody clicks."""

    def __init__(self, running):
        self.running = running
        self.points = running.graph.publisher(PointStamped, 'init_point')

    def click(self, x, y, stamp=0):
        """Publish a point, and wait until it was heard."""
        message = PointStamped()
        message.point.x, message.point.y = x, y
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10 ** 9)
        self.points.publish(message)
        self.running.settle()

    def answer(self):
        """Wait for the answer to the one start that there was, and return it."""
        def answers():
            return [status for status in self.running.statuses if status.start]
        self.running.graph.spin_until(answers)
        found, = answers()
        return found


@pytest.fixture
def clicking(run):
    """Return a node that has seen an image."""
    def start(**values):
        clicking = Clicking(run(**values))
        clicking.running.send()
        return clicking
    return start


def test_start_on_a_point_is_accepted(clicking):
    clicking = clicking()
    clicking.click(20.5, 15.0)
    answer = clicking.answer()
    assert (answer.start, answer.track_id, answer.state) == ('accepted', 1, 'tracking')
    assert clicking.running.send().state == 'tracking'
    # The box of the fake, around the point, moved by a pixel.
    assert clicking.running.last_box == (17.5, 12.0, 8.0, 6.0)


def test_point_is_in_pixels_of_the_full_image(clicking):
    clicking = clicking(crop_left=3, crop_top=2)
    clicking.click(20.5, 15.0)
    clicking.answer()
    assert clicking.running.fake.results[1].box == BoundingBox(13.5, 10.0, 8, 6)
    clicking.running.send()
    assert clicking.running.last_box == (17.5, 12.0, 8.0, 6.0)


def test_start_where_nothing_stands_out_is_refused_with_the_reason(clicking):
    clicking = clicking()
    clicking.running.fake.error = PointError('nothing stands out there')
    clicking.click(20.5, 15.0)
    answer = clicking.answer()
    assert (answer.start, answer.message) == ('refused', 'nothing stands out there')
    assert clicking.running.send().state == 'idle'


@pytest.mark.parametrize('point', [(math.nan, 3.0), (3.0, math.inf)])
def test_point_that_is_none_is_refused(clicking, point):
    clicking = clicking()
    clicking.click(*point)
    answer = clicking.answer()
    assert answer.start == 'refused' and 'not finite' in answer.message
    assert not clicking.running.fake.calls


def test_start_while_disabled_is_refused(clicking):
    clicking = clicking()
    clicking.running.graph.call(SetBool, 'lmsco_tracker/set_enabled', data=False)
    clicking.click(20.5, 15.0)
    assert 'enable it first' in clicking.answer().message


def test_point_with_the_stamp_of_a_frame_starts_there_and_catches_up(clicking):
    clicking = clicking()
    images = [clicking.running.graph.image(value) for value in (1, 2, 3)]
    clicking.running.send(*images)
    stamp = images[1].header.stamp
    clicking.click(20.5, 15.0, stamp.sec * 10 ** 9 + stamp.nanosec)
    clicking.answer()
    assert clicking.running.send(clicking.running.graph.image(4)).state == 'tracking'
    assert [(name, int(image[0, 0])) for name, image in clicking.running.fake.calls] == [
        ('initialize', 2), ('update', 3), ('update', 4)]


@pytest.mark.parametrize('stamp', [0, 1, 10 ** 18])
def test_point_with_the_stamp_of_a_viewer_starts_on_the_newest_frame(clicking, stamp):
    clicking = clicking()
    clicking.running.send(clicking.running.graph.image(7))
    clicking.click(20.5, 15.0, stamp)
    assert clicking.answer().start == 'accepted'
    assert [(name, int(image[0, 0])) for name, image in clicking.running.fake.calls] == [
        ('initialize', 7)]


def test_point_before_the_first_image_waits_for_it(run):
    clicking = Clicking(run())
    clicking.click(20.5, 15.0)
    assert clicking.running.send().start == 'accepted'


def test_points_start_several_targets(clicking):
    clicking = clicking(max_targets=2)
    clicking.click(20.5, 15.0)
    clicking.click(40.5, 15.0)
    clicking.running.graph.spin_until(lambda: len(clicking.running.fake.results) == 2)
    assert clicking.running.send().track_id == 2
