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

"""A bag through the node: every image is answered, and nothing that was answered is lost."""

from functools import partial

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.tracker_node import TrackerNode
from lmsco_ros.replay import bag_replay
from lmsco_ros.replay.bag_replay import Replay, ReplayPlan
from lmsco_ros.replay.bags.stamps import header_stamp
from lmsco_ros.replay.errors import NodeError, OutputError, SourceError, SourceWarning
from lmsco_ros.replay.node_session import NodeSession
from lmsco_ros.replay.storage import Storage

pytestmark = pytest.mark.filterwarnings('ignore::lmsco_ros.replay.errors.SourceWarning')
SECOND = 1_000_000_000
BOX, STATUS = '/lmsco_tracker/box', '/lmsco_tracker/status'


class Follower:
    """Says the value of the image as x; fails at an image with the value 99."""

    def __init__(self):
        self.results = {}

    def initialize(self, image, box, time, in_place_of=()):
        self.results = self.update(image, time)
        return 1

    def update(self, image, time, only=None):
        if image[0, 0] == 99:
            raise RuntimeError('the tracker fails')
        box = BoundingBox(float(image[0, 0]), 1, 2, 2)
        return {1: TrackResult(box, 0.5, TrackState.TRACKING, np.ones((4, 4), np.float32), box)}

    def learn(self):
        pass

    def reset(self):
        self.results = {}


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Return a function that replays a bag through a node with a `Follower`."""
    make_node = partial(TrackerNode, tracker_factory=lambda settings: Follower())
    monkeypatch.setattr(bag_replay, 'NodeSession', partial(NodeSession, make_node=make_node))

    def replay(bag, on_frame=lambda: None, **changes):
        plan = ReplayPlan(**{
            'bag': bag, 'output': tmp_path / 'out', 'storage': Storage.MCAP,
            'boxes': (BoundingBox(1, 1, 2, 2),), 'topic': '', 'rate': 0.0, 'frames': None,
            'parameters': {}, 'outputs': (), **changes})
        replay.last = Replay(plan)
        return replay.last.run(lambda total: None, on_frame)
    return replay


def read(path):
    """Return topic, time of recording and message of everything in a bag."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        return [(connection.topic, logged, reader.deserialize(data, connection.msgtype))
                for connection, logged, data in reader.messages()]


def answers_in(path):
    """Return the value of each image, with what the node said about it, by stamps."""
    messages = read(path)
    boxes = {header_stamp(message): message.polygon.points[0].x
             for topic, _, message in messages if topic == BOX}
    images = [(header_stamp(message), message) for topic, _, message in messages
              if topic == '/image']
    return [(int(message.data[0]), boxes.get(stamp)) for stamp, message in images]


@pytest.mark.parametrize('stamp', [
    lambda i: 0, lambda i: 5 * SECOND, lambda i: (10 + i) // 4 * SECOND, lambda i: -SECOND - i])
def test_images_are_answered_whatever_their_stamps(messages, run, tmp_path, stamp):
    bag = messages.write('bag', ('/image', messages.RAW, [
        (messages.time(i), messages.raw(i, stamp(i))) for i in range(20)]))
    with pytest.warns(SourceWarning, match='no stamp|share stamps'):
        exchanges = run(bag)
    assert [exchange.latency is not None for exchange in exchanges] == [True] * 20
    assert answers_in(tmp_path / 'out') == [(i, i) for i in range(20)]


def test_log_times_that_say_nothing(messages, run, tmp_path):
    times = [0, 0, SECOND, SECOND + 1]
    bag = messages.write('bag', ('/image', messages.RAW, [
        (time, messages.raw(i)) for i, time in enumerate(times)]))
    run(bag)
    assert answers_in(tmp_path / 'out') == [(i, i) for i in range(4)]


def test_pause_of_years(messages, run, tmp_path, monkeypatch):
    """At the pace of the recording, years between two images are no reason to wait."""
    monkeypatch.setattr(bag_replay, '_LONGEST_PAUSE_SECONDS', 0.5)
    bag = messages.write('bag', ('/image', messages.RAW, [
        (logged, messages.raw(i, SECOND + i)) for i, logged in enumerate([0, 10 ** 18])]))
    run(bag, rate=1.0)
    assert answers_in(tmp_path / 'out')[-1] == (1, 1)


def test_image_that_cannot_be_decoded_is_copied_and_left_out(messages, run, tmp_path):
    images = messages.images(10)
    for index in (0, 4, 9):
        images[index] = (images[index][0], messages.raw(
            index, messages.time(index), encoding='no such'))
    with pytest.warns(SourceWarning, match='image 4 on /image .*no such'):
        assert len(run(messages.write('bag', ('/image', messages.RAW, images)))) == 7
    assert answers_in(tmp_path / 'out') == [
        (i, None if i in (0, 4, 9) else i) for i in range(10)]


def test_several_channels_and_other_topics(messages, run, tmp_path):
    images = messages.images(10)
    first = messages.write('bag', ('/image', messages.RAW, images[::2]),
                           ('/chat', messages.TEXT, [(1, messages.text('hi'))]))
    second = messages.write('bag_1', ('/image', messages.RAW, images[1::2]))
    (second / 'bag_1.mcap').rename(first / 'bag_1.mcap')
    (first / 'metadata.yaml').unlink()
    run(first, frames=7)
    assert answers_in(tmp_path / 'out') == [(i, i) for i in range(7)]
    assert [m.data for topic, _, m in read(tmp_path / 'out') if topic == '/chat'] == ['hi']


def test_type_that_nobody_knows_is_copied(messages, run, tmp_path):
    bag = messages.write('bag', ('/image', messages.RAW, messages.images(3)),
                         ('/other', messages.TEXT, [(1, messages.text('hi'))]))
    file = bag / 'bag.mcap'
    file.write_bytes(file.read_bytes().replace(b'std_msgs/msg/String', b'new_msgs/msg/Things')
                     .replace(b'string data', b'#' * 11))
    (bag / 'metadata.yaml').unlink()
    run(bag)
    with AnyReader([tmp_path / 'out']) as reader:
        connection, = (c for c in reader.connections if c.topic == '/other')
        (_, _, data), = reader.messages([connection])
    assert connection.msgtype == 'new_msgs/msg/Things' and b'hi' in data


def test_damaged_bag_is_played_as_far_as_it_goes(messages, run, tmp_path):
    bag = messages.write('bag', ('/image', messages.RAW, messages.images(10)))
    file = bag / 'bag.mcap'
    file.write_bytes(file.read_bytes()[:1500])
    with pytest.warns(SourceWarning, match='is damaged'):
        run(bag)
    answers = answers_in(tmp_path / 'out')
    assert answers == [(i, i) for i in range(len(answers))] and answers


def test_node_that_fails_in_the_middle(messages, run, tmp_path):
    images = messages.images(10)
    images[6] = (images[6][0], messages.raw(99, messages.time(6)))
    with pytest.raises(NodeError, match='the tracker fails'):
        run(messages.write('bag', ('/image', messages.RAW, images)))
    assert [box for _, box in answers_in(tmp_path / 'out')[:6]] == list(range(6))
    assert run.last.kept == (f'kept in {tmp_path / "out"}: the messages so far, with 6 boxes of '
                             'the node')


def test_node_that_fails_at_once_leaves_no_bag(messages, run, tmp_path):
    bag = messages.write('bag', ('/image', messages.RAW, [(1, messages.raw(99, 5))]))
    with pytest.raises(NodeError, match='the tracker fails'):
        run(bag)
    assert run.last.kept == '' and {p.name for p in tmp_path.iterdir()} == {'bag'}


def test_interruption_keeps_what_was_answered(messages, run, tmp_path):
    sent = []

    def on_frame():
        sent.append(len(sent))
        if len(sent) == 50:
            raise KeyboardInterrupt

    bag = messages.write('bag', ('/image', messages.RAW, messages.images(100)))
    with pytest.raises(KeyboardInterrupt):
        run(bag, on_frame)
    answers = answers_in(tmp_path / 'out')
    assert [value for value, _ in answers] == list(range(50))
    assert answers[:47] == [(i, i) for i in range(47)]
    assert 'boxes of the node' in run.last.kept


def test_existing_output_is_refused_before_anything_is_read(run, tmp_path):
    (tmp_path / 'out').mkdir()
    with pytest.raises(OutputError, match='exists'):
        run(tmp_path / 'nothing')


def test_bag_of_ros_1(run, tmp_path):
    from rosbags.rosbag1 import Writer

    with Writer(tmp_path / 'old.bag') as writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        writer.add_connection('/image', 'sensor_msgs/msg/Image', typestore=store)
    with pytest.raises(SourceError, match='rosbags-convert --src .*old.bag'):
        run(tmp_path / 'old.bag')
    assert {path.name for path in tmp_path.iterdir()} == {'old.bag'}
