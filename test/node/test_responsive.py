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

"""While the tracker hangs, an image is costly or a start catches up, the node answers."""

from array import array
import threading

import cv2
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image, RegionOfInterest
from std_srvs.srv import SetBool, Trigger

from lmsco_ros.node import inputs
from msg_adapters.compressed import compressed_from_image
from msg_adapters.image import image_from_message

SECOND = 10 ** 9
PATIENCE = 100.0
KEEP_ALL = QoSProfile(depth=0, history=HistoryPolicy.KEEP_ALL,
                      reliability=ReliabilityPolicy.RELIABLE)
EVERY_IMAGE = {'frame_policy': 'all', 'queue_size': 3, 'image_reliability': 'reliable',
               'image_depth': 0}


def assert_answers(running, health):
    """Call everything that has to answer at any time."""
    graph = running.graph
    label = Parameter('overlay_label', value='x').to_parameter_msg()
    assert graph.call(SetParameters, 'lmsco_tracker/set_parameters',
                      parameters=[label]).results[0].successful
    assert graph.call(GetParameters, 'lmsco_tracker/get_parameters', names=['preset']).values
    assert graph.call(SetBool, 'lmsco_tracker/set_enabled', data=True).success
    assert graph.call(Trigger, 'lmsco_tracker/reset').success
    before = len(health)
    graph.spin_until(lambda: len(health) > before)


def waiting(running):
    """Return how many items wait for the tracker."""
    return len(running.node._session.worker._mailbox)


def test_all_leaves_images_with_the_middleware_while_there_is_no_room(run):
    running = run(**EVERY_IMAGE)
    images = running.graph.user.create_publisher(Image, 'image_raw', KEEP_ALL)
    running.graph.spin_until(lambda: images.get_subscription_count() > 0)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.start()
    running.fake.gate.clear()
    sent = [running.graph.image(number) for number in range(30)]
    for image in sent:
        images.publish(image)
    running.graph.spin_until(lambda: running.fake.calls and waiting(running) == 3)
    assert_answers(running, health)
    assert waiting(running) == 3 and len(running.fake.calls) == 1
    running.fake.gate.set()
    running.graph.spin_until(lambda: len(running.statuses) == 30)
    assert running.status_headers == [image.header for image in sent]
    assert running.statuses[-1].dropped_frames == 0
    # The reset reached everything that came after the first.
    assert [status.state for status in running.statuses] == ['tracking'] + 29 * ['idle']


def test_executor_is_woken_when_there_is_room_again(run, monkeypatch):
    running = run(frame_policy='all', queue_size=1)
    running.start()
    running.send()
    running.fake.gate.clear()
    running.images.publish(running.graph.image())
    running.graph.spin_until(lambda: len(running.fake.calls) == 2)
    running.images.publish(running.graph.image())
    running.graph.spin_until(lambda: waiting(running) == 1)
    woken = threading.Event()
    monkeypatch.setattr(running.graph.executor, 'wake', woken.set)
    assert not woken.is_set()
    running.fake.gate.set()
    assert woken.wait(PATIENCE)


@pytest.mark.parametrize('parameters', [{}, EVERY_IMAGE])
def test_costly_image_is_decoded_beside_the_executor(run, monkeypatch, parameters):
    entered, done = threading.Event(), threading.Event()

    def costly(message):
        entered.set()
        assert done.wait(PATIENCE)
        return image_from_message(message)
    monkeypatch.setattr(inputs, 'image_from_message', costly)
    running = run(**parameters)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    try:
        running.images.publish(running.graph.image())
        running.graph.spin_until(entered.is_set)
        assert_answers(running, health)
    finally:
        done.set()
    running.graph.spin_until(lambda: running.statuses)
    assert running.send().state == 'idle'


def test_costly_image_is_told_in_the_diagnostics(run, monkeypatch):
    done = threading.Event()
    monkeypatch.setattr(inputs, 'image_from_message', lambda message: done.wait(PATIENCE))
    running = run(no_image_timeout=0.1)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    try:
        running.images.publish(running.graph.image())
        running.graph.spin_until(lambda: health and 'one frame' in health[-1].status[0].message)
    finally:
        done.set()


@pytest.mark.parametrize('parameters', [{}, EVERY_IMAGE])
def test_catch_up_is_ended_by_a_reset(run, parameters):
    running = run(**parameters)
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    images = [running.graph.image(number) for number in range(20)]
    running.send(*images)
    running.fake.gate.clear()
    stamp = images[2].header.stamp
    running.start_stamped((20, 12, 8, 6), stamp.sec * SECOND + stamp.nanosec)
    running.graph.spin_until(lambda: running.fake.calls)
    assert_answers(running, health)
    running.fake.gate.set()
    assert running.send().state == 'idle'
    assert len(running.fake.calls) == 1


def test_image_that_cannot_be_read_for_want_of_memory_costs_that_image(running, monkeypatch):
    running.start()
    running.send()
    session = running.node._session
    monkeypatch.setattr('lmsco_ros.node.received.ReceivedImage.read',
                        lambda self: np.zeros(2 ** 48))
    status = running.send()
    assert status.state == 'refused' and 'Memory' in status.message
    monkeypatch.undo()
    status = running.send()
    assert (status.state, status.track_id) == ('tracking', 1)
    assert running.node._session is session


@pytest.mark.parametrize('junk', [
    b'', b'\0', b'\0\1\0\0' + 40 * b'\xff', b'junk' * 100,
    # A whole header, and not much behind it.
    b'\0\1\0\0' + bytes(12) + b'\1\0\0\0\0\0\0\0',
    b'\0\1\0\0' + bytes(8) + b'\x05\0\0\0\xff\xfe\xfdx\0' + bytes(7)])
def test_bytes_that_are_no_image_cost_one_message(running, junk):
    running.start()
    running.send()
    running.images.publish(junk)
    running.graph.spin_until(lambda: running.statuses[-1].state == 'refused')
    assert running.statuses[-1].message
    status = running.send()
    assert (status.state, status.track_id) == ('tracking', 1)
    assert running.node._monitor._counts['faults'] == 0


def test_sender_and_receiver_share_no_memory(running):
    """What a publisher does with its message later changes nothing that was received."""
    running.start()
    images, keep = [], running.fake.inspect
    running.fake.inspect = lambda image: (images.append(image), keep(image))
    message = running.graph.image(5)
    running.send(message)
    message.data = array('B', bytes(len(message.data)))
    running.send(running.graph.image(6), running.graph.image(7))
    assert [np.unique(image).tolist() for image in images] == [[5], [6], [7]]
    assert not any(np.shares_memory(first, second) for first, second in
                   zip(images, images[1:]))


@pytest.mark.parametrize('parameters, word', [
    ({'max_image_pixels': 48 * 64 - 1}, 'pixels'), ({'max_image_pixels': 48 * 64}, '')])
def test_limit_of_pixels_reaches_the_decoder(run, parameters, word):
    running = run(camera=(CompressedImage, 'image_raw/compressed'),
                  image_transport='compressed', **parameters)
    message = compressed_from_image(np.full((48, 64), 9, np.uint8),
                                    header=running.graph.image().header)
    status = running.send(message)
    assert status.state == ('refused' if word else 'idle') and word in status.message


@pytest.mark.parametrize('most, state', [(2, 'refused'), (100, 'idle')])
def test_limit_of_scans_reaches_the_decoder(run, most, state):
    running = run(camera=(CompressedImage, 'image_raw/compressed'),
                  image_transport='compressed', max_jpeg_scans=most)
    _, data = cv2.imencode('.jpg', np.full((48, 64), 9, np.uint8),
                           [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
    message = CompressedImage(header=running.graph.image().header, format='mono8; jpeg',
                              data=array('B', data.tobytes()))
    status = running.send(message)
    assert status.state == state and ('scan' in status.message) == (state == 'refused')


def test_history_of_compressed_images_takes_what_was_sent(run):
    running = run(camera=(CompressedImage, 'image_raw/compressed'),
                  image_transport='compressed', frame_history_megabytes=1)
    picture = np.zeros((480, 640), np.uint16)
    header = running.graph.image().header
    message = compressed_from_image(picture, header=header)
    for _ in range(5):
        running.images.publish(message)
    history = running.node._session.worker._history
    running.graph.spin_until(lambda: len(history) == 5)
    taken = sum(frame.nbytes for frame in history)
    # With the header, and what tells of the encoding.
    assert 0 <= taken - 5 * len(message.data) < 5 * 200 and taken < picture.nbytes


def test_history_is_bounded_in_bytes(run):
    running = run(frame_history_megabytes=1)
    images = [running.graph.image(number, shape=(480, 640)) for number in range(4)]
    running.send(*images)
    assert len(running.node._session.worker._history) == 1
    running.init_box.publish(RegionOfInterest(x_offset=1, y_offset=2, width=8, height=6))
    running.graph.spin_until(lambda: running.boxes)
    assert (running.fake.calls[0][1] == 3).all()
