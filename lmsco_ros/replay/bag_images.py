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

"""Images of a rosbag2, sqlite3 or mcap, read without ROS."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import struct
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.errors import SourceError
from lmsco_ros.replay.frame import Frame
from msg_adapters.errors import MessageError

RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
_BAG_SUFFIXES = ('.mcap', '.db3')
_DEFAULT_FPS = 30.0


def is_bag(path: Path) -> bool:
    """Tell whether `path` is a rosbag2: its folder, or a storage file."""
    if path.is_dir():
        return (path / 'metadata.yaml').is_file()
    return path.suffix in _BAG_SUFFIXES


@contextmanager
def open_bag(path: Path) -> Iterator[AnyReader]:
    """
    Open a bag for reading.

    Raises
    ------
    SourceError
        When it is damaged or no bag.

    """
    try:
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
        reader.open()
    except (AnyReaderError, OSError) as error:
        raise SourceError(f'{path} cannot be read as a bag ({error}); '
                          'give the folder with its metadata.yaml') from error
    # Readers fail in many ways on damaged storage, none of which is ours to tell apart.
    except Exception as error:  # noqa: B902
        raise SourceError(f'{path} is damaged ({type(error).__name__}: {error}); '
                          'repair it with "ros2 bag reindex" or record it again') from error
    try:
        yield reader
    finally:
        reader.close()


def choose_connection(reader: AnyReader, path: Path, topic: str) -> Connection:
    """
    Return the connection of the wanted image topic.

    Parameters
    ----------
    reader : AnyReader
        The open bag.
    path : Path
        Its name, for messages.
    topic : str
        With or without the leading slash; empty when there is only one image topic.

    Raises
    ------
    SourceError
        When there is no such image topic, or several to choose from.

    """
    images = {c.topic: c for c in reader.connections if c.msgtype in (RAW, COMPRESSED)}
    names = ', '.join(sorted(images))
    if not images:
        others = ', '.join(sorted({c.topic for c in reader.connections})) or 'nothing'
        raise SourceError(f'{path} has no image topic; it holds {others}')
    if topic:
        wanted = '/' + topic.lstrip('/')
        if wanted not in images:
            raise SourceError(f'{path} has no image topic {wanted}; it has {names}')
        return images[wanted]
    if len(images) > 1:
        raise SourceError(f'{path} has several image topics; choose one with --topic: {names}')
    return next(iter(images.values()))


def header_stamp(message: Any) -> int:
    """Return the stamp of a message's header, in nanoseconds."""
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def serialized_stamp(data: bytes) -> int:
    """Return the header stamp, in nanoseconds, of a serialized message that has one."""
    order = '<' if data[1] & 1 else '>'
    seconds, nanoseconds = struct.unpack_from(f'{order}iI', data, 4)
    return seconds * 1_000_000_000 + nanoseconds


class BagImages:
    """
    Frames of one image topic of a bag.

    Parameters
    ----------
    path : Path
        The bag.
    topic : str
        Image topic; may be empty when there is only one.

    """

    def __init__(self, path: Path, topic: str = '') -> None:
        self._path = path
        with open_bag(path) as reader:
            connection = choose_connection(reader, path, topic)
            self.topic = connection.topic
            self._length = connection.msgcount
            seconds = (reader.end_time - reader.start_time) * 1e-9
        if not self._length:
            raise SourceError(f'{path} has no message on {self.topic}; record some images')
        self.fps = (self._length - 1) / seconds if self._length > 1 and seconds > 0 \
            else _DEFAULT_FPS

    def __len__(self) -> int:
        """Return the number of messages on the topic."""
        return self._length

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, with the stamps of their headers where these are set."""
        # Folders and videos are read through the same door, and need no messages.
        from msg_adapters.compressed import image_from_compressed
        from msg_adapters.image import image_from_message

        with open_bag(self._path) as reader:
            connection = choose_connection(reader, self._path, self.topic)
            decode = image_from_message if connection.msgtype == RAW else image_from_compressed
            messages = reader.messages([connection])
            for index, (_, logged, data) in enumerate(messages):
                message = reader.deserialize(data, connection.msgtype)
                try:
                    image = decode(message)
                except MessageError as error:
                    raise SourceError(
                        f'{self._path}, message {index} on {self.topic}: {error}') from error
                yield Frame(index, header_stamp(message) or logged, image)
