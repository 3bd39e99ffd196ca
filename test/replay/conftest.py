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

"""Small recordings of every kind."""

import cv2
import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bag_maker import image_message
from lmsco_ros.replay.frame import RecordedFrame
from lmsco_ros.replay.storage import Storage


def counts(index, shape=(48, 64), dtype=np.uint16):
    """Return an image that is different for every index."""
    image = np.random.default_rng(index).integers(0, 200, shape)
    return (image + (7000 if dtype == np.uint16 else 0)).astype(dtype)


@pytest.fixture
def frames():
    """Return ten 16-bit frames at 25 Hz."""
    return [RecordedFrame(i, i * 40_000_000, counts(i)) for i in range(10)]


@pytest.fixture
def folder(tmp_path, frames):
    """Return a folder of 16-bit images whose names need natural order."""
    path = tmp_path / 'images'
    path.mkdir()
    for frame in frames:
        cv2.imwrite(str(path / f'frame{frame.index + 1}.png'), frame.image)
    return path


@pytest.fixture
def video(tmp_path):
    """Return a film of twelve gray frames at 20 Hz; frame i has the brightness 10 i + 50."""
    path = tmp_path / 'film.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*'MJPG'), 20, (64, 48))
    for index in range(12):
        writer.write(np.full((48, 64, 3), 10 * index + 50, np.uint8))
    writer.release()
    return path


class Messages:
    """Makes messages of a type store, which needs no ROS, and bags with them."""

    RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
    TEXT = 'std_msgs/msg/String'

    # What it takes to write a type is made once.
    store = get_typestore(Stores.ROS2_JAZZY)

    def __init__(self, folder):
        self.folder = folder

    def raw(self, value=7, stamp=0, **changes):
        """Return a small image of one value."""
        message = image_message(self.store, np.full((4, 6), value, np.uint8), 0, 'camera')
        for name, change in changes.items():
            setattr(message, name, change)
        return self._stamped(message, stamp)

    def compressed(self, image, stamp=0):
        """Return an image as png."""
        types = self.store.types
        return self._stamped(types[self.COMPRESSED](
            header=types['std_msgs/msg/Header'](
                stamp=types['builtin_interfaces/msg/Time'](sec=0, nanosec=0), frame_id=''),
            format='png', data=cv2.imencode('.png', image)[1].reshape(-1)), stamp)

    def text(self, content):
        """Return a text."""
        return self.store.types[self.TEXT](data=content)

    def write(self, name, *streams, storage=Storage.MCAP, compression=None):
        """
        Write a bag and return its folder.

        A stream is a topic, a type, and messages with their times of recording; after these
        may come the quality of service.
        """
        writer = Writer(self.folder / name, version=9, storage_plugin=StoragePlugin[
            storage.name])
        if compression is not None:
            writer.set_compression(compression, CompressionFormat.ZSTD)
        with writer:
            for topic, kind, messages, *qos in streams:
                connection = writer.add_connection(topic, kind, typestore=self.store,
                                                   offered_qos_profiles=qos)
                for logged, message in messages:
                    data = message if isinstance(message, bytes) else \
                        self.store.serialize_cdr(message, kind)
                    writer.write(connection, logged, data)
        return self.folder / name

    def images(self, count, first=0):
        """Return images with the values `first`, ..., at 10 Hz, recorded at their stamps."""
        return [(self.time(index), self.raw(index, self.time(index)))
                for index in range(first, first + count)]

    @staticmethod
    def time(index):
        """Return the stamp of an image of `images`."""
        return (100 + index) * 100_000_000

    @staticmethod
    def _stamped(message, stamp):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10 ** 9)
        return message


@pytest.fixture
def messages(tmp_path):
    """Return what makes messages, and bags in the folder of the test."""
    return Messages(tmp_path)


def values_of(source):
    """Return the first pixel of each frame, by which tests know their images."""
    return [int(frame.image[0, 0]) for frame in source]


@pytest.fixture
def values():
    """Return the function that tells images by their first pixels."""
    return values_of
