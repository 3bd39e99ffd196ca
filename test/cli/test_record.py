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

"""`lmsco record`: what camera and tracker say into a bag, until a signal or the time ends it."""

import signal

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import CompressedImage, Image

from lmsco_ros.replay import live_recording, recorder
from lmsco_ros.replay.errors import OutputError
from msg_adapters.compressed import compressed_from_image
from msg_adapters.image import message_from_image

PATIENCE_SECONDS = 100.0
TOLD = {'status': DiagnosticArray, 'box': PolygonStamped, 'boxes': PolygonInstanceStamped,
        'state': Odometry}
PIXELS = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)


@pytest.fixture
def robot():
    """Return a node that speaks for camera and tracker."""
    context = Context()
    context.init()
    node = Node('robot', context=context, namespace='/front')
    yield node
    node.destroy_node()
    context.try_shutdown()


class Speaker:
    """Says the same on all topics of camera and tracker."""

    def __init__(self, robot, image, topic):
        self.publishers = [(robot.create_publisher(kind, f'thermal/{name}', 10), kind())
                           for name, kind in TOLD.items()]
        self.publishers.append((robot.create_publisher(type(image), topic, 10), image))

    def is_heard(self):
        return all(publisher.get_subscription_count() for publisher, _ in self.publishers)

    def speak(self):
        for publisher, message in self.publishers:
            publisher.publish(message)


def read(bag):
    """Return the messages of a bag by their topics."""
    found = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(
                reader.deserialize(data, connection.msgtype))
    return found


@pytest.mark.parametrize('image, topic', [
    (message_from_image(PIXELS), 'image_raw'),
    (compressed_from_image(PIXELS), 'image_raw/compressed')], ids=['raw', 'compressed'])
def test_images_boxes_and_state_are_recorded(robot, tmp_path, image, topic):
    speaker = Speaker(robot, image, topic)

    def advance(counts):
        speaker.speak()
        if all(counts.values()):
            raise KeyboardInterrupt

    run = live_recording.LiveRecording(live_recording.LivePlan(
        tmp_path / 'above' / 'flight', compressed=topic != 'image_raw', tracker='thermal',
        namespace='/front'), print)
    assert run.kept == ''
    with pytest.raises(KeyboardInterrupt):
        run.run(advance)
    found = read(tmp_path / 'above' / 'flight')
    assert found.keys() == {f'/front/{topic}', *(f'/front/thermal/{name}' for name in TOLD)}
    assert bytes(found[f'/front/{topic}'][0].data) == bytes(image.data)
    assert f'{sum(map(len, found.values()))} messages are in' in run.kept
    assert all(f'{name} {len(messages)}' in run.kept for name, messages in found.items())


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=['SIGINT', 'SIGTERM'])
def test_signal_ends_it_and_the_bag_is_whole(lmsco_process, robot, tmp_path, until, number):
    speaker = Speaker(robot, message_from_image(PIXELS), 'image_raw')
    process = lmsco_process('record', '--output', tmp_path / 'flight', '--namespace', '/front',
                            '--tracker', 'thermal')
    until(speaker.is_heard)
    for _ in range(100):
        speaker.speak()
    process.send_signal(number)
    _, complaints = process.communicate(timeout=PATIENCE_SECONDS)
    assert process.returncode == 128 + number and 'Traceback' not in complaints
    count = sum(map(len, read(tmp_path / 'flight').values()))
    assert f'{count} messages are in {tmp_path / "flight"}' in complaints


def test_time_ends_it_and_a_silent_camera_is_told(lmsco, tmp_path, monkeypatch):
    monkeypatch.setattr(live_recording, '_PATIENCE_SECONDS', 0.05)
    outcome = lmsco('record', '--output', tmp_path / 'flight', '--seconds', 0.4,
                    '--namespace', '/silent')
    assert outcome.exit_code == 0 and 'no image has come on /silent/image_raw' in outcome.words
    assert '0 messages are in' in outcome.words and read(tmp_path / 'flight') == {}


@pytest.mark.parametrize('arguments, words', [
    (['--image-topic', 'a b'], 'topic name'), (['--tracker', '7'], 'number'),
    (['--namespace', 'a b'], 'remapping'), (['--seconds', '0'], '--seconds')])
def test_what_cannot_be_is_told_and_leaves_nothing(lmsco, tmp_path, arguments, words):
    outcome = lmsco('record', '--output', tmp_path / 'flight', *arguments)
    assert outcome.exit_code in (1, 2) and words in outcome.words
    assert not list(tmp_path.iterdir())


def test_bag_that_is_there_is_left_alone(lmsco, tmp_path):
    (tmp_path / 'flight').mkdir()
    outcome = lmsco('record', '--output', tmp_path / 'flight')
    assert outcome.exit_code == 1 and 'exists' in outcome.words
    assert not list((tmp_path / 'flight').iterdir())


def test_disk_that_is_full_ends_the_recording_and_leaves_no_bag(robot, tmp_path, monkeypatch):
    errors = []
    machine = recorder.Recorder(robot, {'image_raw': Image}, errors.append)
    machine.start(tmp_path / 'flight')
    with pytest.raises(OutputError, match='already'):
        machine.start(tmp_path / 'second')
    take = next(each.callback for each in robot.subscriptions
                if each.topic_name.endswith('image_raw'))
    take(b'message')
    assert machine.count == 1

    def full(*arguments):
        raise OSError(28, 'No space left on device')
    monkeypatch.setattr('rosbags.rosbag2.Writer.write', full)
    take(b'message')
    take(b'what was under way')
    assert machine.count is None and 'No space left' in str(errors.pop()) and not errors
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()
    machine.start(tmp_path / 'third')
    assert machine.stop() == 0 and (tmp_path / 'third').is_dir() and machine.stop() == 0


def test_error_while_it_begins_leaves_nothing(robot, tmp_path, monkeypatch):
    def broken(*arguments, **more):
        raise RuntimeError('no subscription')
    monkeypatch.setattr(robot, 'create_subscription', broken)
    with pytest.raises(RuntimeError):
        recorder.Recorder(robot, {'image_raw': CompressedImage}, print).start(tmp_path / 'flight')
    assert not list(tmp_path.iterdir())
