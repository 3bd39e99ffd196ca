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


"""Cameras, users and trackers that misbehave: nothing crashes, hangs or says what is stale."""

from array import array
import threading

from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import given, HealthCheck, settings, strategies as st
import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image, RegionOfInterest
from std_msgs.msg import Header

from lmsco_ros.core.errors import ImageError
from msg_adapters.encodings import ENCODINGS
from msg_adapters.status import diagnoses_from_message, Level

SIZES = st.integers(0, 70) | st.integers(0, 2 ** 32 - 1)
# On the wire a string ends at its first zero.
TEXTS = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=8)
SECOND = 10 ** 9


@st.composite
def wild_images(draw):
    """Draw any image that the message type can hold, most of them nonsense."""
    message = Image(
        header=Header(frame_id=draw(TEXTS)), height=draw(SIZES),
        width=draw(SIZES), step=draw(SIZES), is_bigendian=draw(st.integers(0, 255)),
        encoding=draw(st.sampled_from(sorted(ENCODINGS)) | TEXTS),
        data=array('B', draw(st.binary(max_size=300))))
    message.header.stamp.sec = draw(st.integers(-2 ** 31, 2 ** 31 - 1))
    message.header.stamp.nanosec = draw(st.integers(0, 2 ** 32 - 1))
    return message


@pytest.mark.parametrize('crop', [{}, {'crop_top': 2, 'crop_left': 1}])
def test_every_image_is_answered_and_the_target_survives_it(run, crop):
    running = run(**crop)
    running.start()
    assert running.send(running.graph.image()).state == 'tracking'

    @settings(max_examples=60, suppress_health_check=list(HealthCheck))
    @given(wild_images())
    def check(message):
        status = running.send(message)
        assert status.state in ('refused', 'tracking')
        assert status.state == 'tracking' or status.message and status.level == Level.ERROR
    check()
    status = running.send(running.graph.image())
    assert (status.state, status.track_id) == ('tracking', 1)


def test_camera_that_stops_is_stale_and_comes_back_unhurt(run):
    running = run(no_image_timeout=0.1)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.start()
    running.send()
    boxes = len(running.boxes)
    running.graph.spin_until(lambda: health and health[-1].status[0].level == b'\x03')
    diagnosis, = diagnoses_from_message(health[-1])
    assert diagnosis.level == Level.STALE and '/user could be heard' in diagnosis.message
    # Silence is no reason to repeat a box.
    assert len(running.boxes) == boxes
    running.graph.user.destroy_publisher(running.images)
    running.graph.spin_until(lambda: 'nobody publishes' in health[-1].status[0].message)
    running.images = running.graph.publisher(Image, 'image_raw')
    assert running.send().state == 'tracking'


def test_camera_that_changes_its_format_is_refused_until_a_new_start(running):
    sizes = []

    def picky(image):
        sizes.append((image.shape, image.dtype))
        if sizes[-1] != sizes[0]:
            raise ImageError('the frame is another one; initialize again')
    running.fake.inspect = picky
    running.start()
    running.send()
    boxes = len(running.boxes)
    for image in (running.graph.image(shape=(24, 32)), running.graph.image(dtype=np.uint8)):
        status = running.send(image)
        assert status.state == 'refused' and 'initialize again' in status.message
    assert len(running.boxes) == boxes
    sizes.clear()
    running.start()
    running.graph.spin_until(lambda: len(running.boxes) > boxes)
    assert running.send(running.graph.image(dtype=np.uint8)).track_id == 2


@pytest.mark.parametrize('stamps', [
    [50, 51, 3, 4],
    [1, 2, 2 ** 31 - 1, 3],
    [0, 0, 0, 0],
    [-5, -4, 0, 1],
], ids=['bag loop', 'far forward and back', 'clock at zero', 'before 1970'])
def test_jumping_stamps_do_not_disturb_the_track(run, stamps):
    running = run(use_sim_time=True)
    running.start()
    for seconds in stamps:
        image = running.graph.image(stamp=seconds * SECOND)
        status = running.send(image)
        assert (status.state, status.track_id) == ('tracking', 1)
        assert running.boxes[-1].header == image.header
        assert 0 <= status.latency_ms < 60e3
    # Only what came since the last jump back can be started on.
    running.start_stamped((1, 2, 3, 4), stamps[-1] * SECOND)
    running.graph.spin_until(lambda: running.statuses[-1].track_id == 2)


def test_health_is_told_while_a_simulated_clock_stands_still(run):
    running = run(use_sim_time=True, no_image_timeout=0.1)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.graph.spin_until(lambda: len(health) >= 2)
    assert health[-1].header.stamp.sec == 0
    assert diagnoses_from_message(health[-1])[0].level == Level.STALE


def test_thousand_starts_at_once_cost_a_bounded_number_of_steps(running):
    images = [running.graph.image(value) for value in range(5)]
    running.send(*images)
    stamp = images[1].header.stamp
    running.fake.gate.clear()
    for number in range(500):
        running.init_box.publish(
            RegionOfInterest(x_offset=number % 40, y_offset=3, width=8, height=6))
        running.start_stamped((20, 12, 8, 6), stamp.sec * SECOND + stamp.nanosec)
    running.fake.gate.set()
    running.start(33, 12, 8, 6)
    running.graph.spin_until(lambda: running.boxes and running.last_box == (33, 12, 8, 6))
    # The start that the tracker was at, the last of the flood with its frames, and the latest.
    assert len(running.fake.calls) <= 1 + 4 + 1
    assert running.send().state == 'tracking'
    assert running.last_box == (34, 12, 8, 6)


def test_image_flood_is_dropped_and_the_newest_is_answered(run):
    running = run(image_reliability='reliable', image_depth=0)
    running.start()
    running.send()
    running.fake.gate.clear()
    images = [running.graph.image(number) for number in range(500)]
    running.images.publish(images[0])
    running.graph.spin_until(lambda: len(running.fake.calls) == 2)
    for image in images[1:]:
        running.images.publish(image)
        running.graph.executor.spin_once(timeout_sec=0)
    running.settle()
    received = running.node._monitor._counts
    running.graph.spin_until(lambda: received['received'] == 501)
    running.fake.gate.set()
    running.graph.spin_until(lambda: running.status_headers[-1] == images[-1].header)
    assert running.statuses[-1].dropped_frames == 498
    running.graph.answer(running.boxes, images[-1])


def test_listener_that_never_reads_holds_nobody_up(running, other_graph):
    reliable = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
    for kind, topic in ((Image, 'overlay'), (Image, 'confidence_map'),
                        (DiagnosticArray, 'status')):
        other_graph.user.create_subscription(kind, f'lmsco_tracker/{topic}', print, reliable)
    running.graph.spin_until(lambda: all(
        publisher.get_subscription_count() > 0 for publisher in running.node.publishers
        if publisher.topic_name.endswith(('overlay', 'confidence_map'))))
    running.start()
    for _ in range(100):
        assert running.send(running.graph.image(shape=(240, 320))).state == 'tracking'
    assert running.statuses[-1].dropped_frames == 0


@pytest.mark.parametrize('error', [
    RuntimeError('wrong'), MemoryError(), RecursionError('deep'), np.linalg.LinAlgError('odd'),
    AssertionError(), ImageError('no finite pixel')], ids=lambda error: type(error).__name__)
def test_whatever_the_tracker_raises_the_node_goes_on(running, error):
    threads = threading.active_count()
    running.start()
    running.send()
    running.fake.error = error
    status = running.send()
    expected = 'refused' if isinstance(error, ImageError) else 'failed'
    assert (status.state, status.level) == (expected, Level.ERROR) and status.message
    assert len(running.boxes) == 1
    running.start()
    assert running.send().state == 'tracking'
    assert threading.active_count() == threads


def test_tracker_that_does_not_come_back_is_reported(run):
    running = run(no_image_timeout=0.1)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.start()
    running.fake.gate.clear()
    running.images.publish(running.graph.image())
    running.graph.spin_until(lambda: health and 'one frame' in health[-1].status[0].message)
    assert diagnoses_from_message(health[-1])[0].level == Level.ERROR
