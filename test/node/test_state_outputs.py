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

"""What a robot steers by, over real ROS messages: states, predicted boxes, bearings."""

from dataclasses import replace

from geometry_msgs.msg import PolygonStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo

from lmsco_ros.core.types import TrackState
from msg_adapters.boxes import box_from_polygon
from msg_adapters.state import state_from_odometry

# Of the images of the graph, 64 x 48, with the optical axis through the place (22.5, 10.5).
CALIBRATION = dict(width=64, height=48, distortion_model='plumb_bob', d=[0.0] * 5,
                   k=[100.0, 0.0, 22.0, 0.0, 100.0, 10.0, 0.0, 0.0, 1.0])


class Steering:
    """A node with the topics that a robot steers by."""

    def __init__(self, running):
        self.running, self.graph = running, running.graph
        self.states = self.graph.listen(Odometry, 'lmsco_tracker/state')
        self.predicted = self.graph.listen(PolygonStamped, 'lmsco_tracker/predicted_box')
        self.bearings = self.graph.listen(PoseWithCovarianceStamped, 'lmsco_tracker/bearing')
        self.infos = self.graph.publisher(CameraInfo, 'camera_info')

    def calibrate(self, **changes):
        """Publish a camera_info, and wait until it was heard."""
        self.infos.publish(CameraInfo(**CALIBRATION | changes))
        self.running.settle()

    def answered(self, state='tracking'):
        """Send an image and wait for the states that go with it; return the image."""
        image = self.graph.image()
        assert self.running.send(image).state == state
        self.graph.spin_until(lambda: len(self.of(self.states, image))
                              == len(self.running.fake.results))
        # What was said besides has been handed out by then, if there was anything.
        self.running.settle()
        return image

    def of(self, messages, image):
        """Return the messages that belong to an image."""
        return [message for message in messages if message.header == image.header]


@pytest.fixture
def steering(run):
    """Return a node that follows a target, started at (10, 12) with 8 x 6 pixels."""
    def start(**values):
        running = run(**values)
        steering = Steering(running)
        running.send()
        running.start()
        return steering
    return start


def warnings(capfd, text):
    """Return how often a text was logged since the last time."""
    return capfd.readouterr().err.count(text)


def test_state_of_every_target_has_center_velocity_and_covariance(steering):
    steering = steering(max_targets=3)
    steering.answered()
    steering.running.start(30, 12, 8, 6)
    steering.graph.spin_until(lambda: len(steering.running.fake.results) == 2)
    image = steering.answered()
    told = {state.track_id: state
            for state in map(state_from_odometry, steering.of(steering.states, image))}
    assert set(told) == {1, 2}
    for number, target in told.items():
        # Of the prediction, which is what the covariance is of.
        predicted = steering.running.fake.results[number].predicted_box
        assert target.center == predicted.center and target.velocity == (30.0, -15.0)
        np.testing.assert_array_equal(target.covariance, np.diag([1.0, 4.0]))
        np.testing.assert_array_equal(target.velocity_covariance, [[25, 5], [5, 36]])


def test_state_goes_on_while_lost_and_the_box_does_not(steering):
    steering = steering()
    steering.answered()
    boxes = len(steering.running.boxes)
    steering.running.fake.states = [TrackState.LOST, TrackState.UNCERTAIN]
    image = steering.answered('lost')
    message = steering.graph.answer(steering.predicted, image)
    predicted = steering.running.fake.results[1].predicted_box
    assert box_from_polygon(message) == predicted.as_tuple()
    assert len(steering.running.boxes) == boxes
    later = steering.answered('uncertain')
    assert steering.graph.answer(steering.running.boxes, later)
    assert [each.header for each in steering.predicted] == [image.header]


def test_predicted_box_is_that_of_the_selected_target(steering):
    steering = steering(max_targets=2)
    steering.answered()
    steering.running.start(30, 12, 8, 6)
    steering.graph.spin_until(lambda: len(steering.running.fake.results) == 2)
    # The second one is selected.
    steering.running.fake.states = [TrackState.LOST, TrackState.TRACKING,
                                    TrackState.TRACKING, TrackState.LOST]
    steering.answered()
    image = steering.answered('lost')
    steering.graph.answer(steering.predicted, image)
    assert [each.header for each in steering.predicted] == [image.header]


def test_places_are_in_pixels_of_the_full_image(steering):
    steering = steering(crop_left=5, crop_top=3)
    steering.running.fake.states = [TrackState.TRACKING, TrackState.LOST]
    place, = steering.of(steering.states, steering.answered())
    inside = steering.running.fake.results[1].predicted_box
    assert state_from_odometry(place).center == (inside.center[0] + 5, inside.center[1] + 3)
    message = steering.graph.answer(steering.predicted, steering.answered('lost'))
    lost = steering.running.fake.results[1].predicted_box
    assert box_from_polygon(message)[:2] == (lost.x + 5, lost.y + 3)


def test_bearing_is_the_ray_to_the_selected_target(steering):
    steering = steering()
    steering.answered()
    assert not steering.bearings
    steering.calibrate()
    image = steering.answered()
    message = steering.graph.answer(steering.bearings, image)
    x, y = steering.running.fake.results[1].predicted_box.center
    place = message.pose.pose.position
    assert (place.x / place.z, place.y / place.z) == pytest.approx(
        ((x - 22.5) / 100, (y - 10.5) / 100), abs=1e-6)
    covariance = np.reshape(message.pose.covariance, (6, 6))
    assert covariance[0, 0] == pytest.approx(1e-4, rel=0.02)
    assert covariance[1, 1] == pytest.approx(4e-4, rel=0.02)
    steering.running.fake.states = [TrackState.LOST]
    assert steering.graph.answer(steering.bearings, steering.answered('lost'))


def test_camera_without_calibration_is_told_once(steering, capfd):
    steering = steering()
    for _ in range(3):
        steering.calibrate(k=[0.0] * 9)
        steering.answered()
    assert warnings(capfd, 'holds no calibration (K[0] is 0)') == 1
    assert not steering.bearings
    steering.calibrate()
    assert steering.graph.answer(steering.bearings, steering.answered())
    # One that cannot be used takes the place of one that could be.
    bearings = len(steering.bearings)
    steering.calibrate(distortion_model='pinwheel')
    steering.answered()
    steering.answered()
    assert len(steering.bearings) == bearings and warnings(capfd, 'pinwheel') == 1


def test_calibration_of_other_images_is_told_once(steering, capfd):
    steering = steering()
    steering.calibrate(width=640, height=480)
    for _ in range(3):
        steering.answered()
    assert warnings(capfd, 'of images of 640 x 480 pixels') == 1 and not steering.bearings


def test_tracker_that_tells_no_motion_has_no_state(steering):
    steering = steering()
    steering.answered()
    fake, made = steering.running.fake, steering.running.fake._result
    fake._result = lambda box, state: replace(made(box, state), covariance=None)
    states = len(steering.states)
    assert steering.running.send().state == 'tracking'
    steering.running.settle()
    assert len(steering.states) == states
