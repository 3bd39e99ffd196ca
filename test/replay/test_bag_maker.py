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

"""Bags hold every pixel, in types that any viewer knows."""

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bag_maker import make_bag
from lmsco_ros.replay.errors import OutputError, SourceError
from lmsco_ros.replay.frame import RecordedFrame
from lmsco_ros.replay.storage import Storage

START = 1_700_000_000_000_000_000


@pytest.mark.parametrize('storage', list(Storage))
@pytest.mark.parametrize('dtype, shape, encoding', [
    (np.uint8, (5, 7), 'mono8'), (np.uint16, (5, 7), 'mono16'), (np.float32, (5, 7), '32FC1'),
    (np.uint8, (5, 7, 3), 'bgr8')])
def test_messages(tmp_path, storage, dtype, shape, encoding):
    images = [np.random.default_rng(i).integers(0, 255, shape).astype(dtype) for i in range(3)]
    frames = [RecordedFrame(i, i * 100, image) for i, image in enumerate(images)]
    path = tmp_path / 'new' / 'bag'
    assert make_bag(frames, path, topic='a/b', frame_id='camera', storage=storage,
                    start_ns=START) == 3
    # Without types from elsewhere: the definitions are in the bag.
    with AnyReader([path]) as reader:
        messages = [(c.topic, t, reader.deserialize(d, c.msgtype))
                    for c, t, d in reader.messages()]
    for index, (topic, logged, message) in enumerate(messages):
        assert topic == '/a/b' and logged == START + 100 * index
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(
            START + 100 * index, 10 ** 9)
        assert message.header.frame_id == 'camera' and message.encoding == encoding
        assert (message.height, message.width) == shape[:2]
        assert message.step * message.height == message.data.size
        np.testing.assert_array_equal(message.data.view(dtype).reshape(shape), images[index])


def test_rows_that_are_not_contiguous(tmp_path):
    image = np.arange(48, dtype=np.uint16).reshape(6, 8)[:, ::2]
    make_bag([RecordedFrame(0, 1, image)], tmp_path / 'bag', topic='i', frame_id='',
             storage=Storage.MCAP, start_ns=0)
    with AnyReader([tmp_path / 'bag'],
                   default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        (connection, _, data), = reader.messages()
        message = reader.deserialize(data, connection.msgtype)
    np.testing.assert_array_equal(message.data.view(np.uint16).reshape(6, 4), image)


@pytest.mark.parametrize('error', [KeyboardInterrupt, SourceError('the next image is damaged')])
def test_frames_before_the_source_breaks_off_are_kept(tmp_path, frames, error):
    def broken():
        yield from frames[:3]
        raise error

    with pytest.raises(type(error) if isinstance(error, Exception) else error):
        make_bag(broken(), tmp_path / 'bag', topic='i', frame_id='', storage=Storage.MCAP,
                 start_ns=0)
    with AnyReader([tmp_path / 'bag']) as reader:
        assert len(list(reader.messages())) == 3


@pytest.mark.parametrize('stamp', [-1, 2 ** 31 * 10 ** 9])
def test_stamp_that_no_message_holds(tmp_path, stamp):
    with pytest.raises(OutputError, match='no message holds the stamp'):
        make_bag([RecordedFrame(0, stamp, np.zeros((4, 4), np.uint8))], tmp_path / 'bag',
                 topic='i', frame_id='', storage=Storage.MCAP, start_ns=0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('topic', ['', '/', 'two words', '/a//b', 'a/', '1st', 'größe', 'a\n',
                                   '~/image', 'a' * 247])
def test_topic_that_ros_cannot_play(tmp_path, topic):
    with pytest.raises(OutputError, match='is no name of a topic; expected names of letters'):
        make_bag([RecordedFrame(0, 1, np.zeros((4, 4), np.uint8))], tmp_path / 'bag',
                 topic=topic, frame_id='', storage=Storage.MCAP, start_ns=0)
    assert not list(tmp_path.iterdir())


def test_image_without_an_encoding(tmp_path):
    with pytest.raises(OutputError, match='float64'):
        make_bag([RecordedFrame(0, 1, np.zeros((4, 4)))], tmp_path / 'bag', topic='i', frame_id='',
                 storage=Storage.MCAP, start_ns=0)
