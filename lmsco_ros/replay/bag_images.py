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

"""Images of a bag, read without ROS."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import warnings

import numpy.typing as npt

from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.bags.reader import BagReader, open_bag
from lmsco_ros.replay.bags.stamps import header_stamp, ImageStamps
from lmsco_ros.replay.errors import SourceError, SourceWarning
from lmsco_ros.replay.frame import RecordedFrame

RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
_DEFAULT_FPS = 30.0
# So many images at the beginning that cannot be decoded say that none can.
_HOPELESS = 30
_SKIPPED_TOLD = 3


@dataclass(frozen=True)
class ImageTopic:
    """
    A topic of images in a bag.

    Attributes
    ----------
    name : str
        With the leading slash.
    msgtype : str
        RAW or COMPRESSED.
    channels : tuple of Channel
        All streams of the topic; several where recordings were joined or split.

    """

    name: str
    msgtype: str
    channels: tuple[Channel, ...]

    def __len__(self) -> int:
        """Return the number of messages."""
        return sum(channel.count for channel in self.channels)


def choose_topic(reader: BagReader, path: Path, topic: str) -> ImageTopic:
    """
    Return the wanted image topic.

    Parameters
    ----------
    reader : BagReader
        The open bag.
    path : Path
        Its name, for messages.
    topic : str
        With or without the leading slash; empty when there is only one image topic.

    Raises
    ------
    SourceError
        When there is no such image topic, several to choose from, or no message on it.

    """
    images = [channel for channel in reader.channels if channel.msgtype in (RAW, COMPRESSED)]
    names = sorted({channel.topic for channel in images})
    if not images:
        others = ', '.join(sorted({channel.topic for channel in reader.channels})) or 'nothing'
        raise SourceError(f'{path} has no image topic; it holds {others}')
    wanted = '/' + topic.lstrip('/') if topic else names[0]
    # Topics of ROS 1 may have no slash.
    chosen = [channel for channel in images if '/' + channel.topic.lstrip('/') == wanted
              or channel.topic == wanted]
    if not chosen:
        raise SourceError(f'{path} has no image topic {wanted}; it has {", ".join(names)}')
    if not topic and len(names) > 1:
        raise SourceError(f'{path} has several image topics; choose one with --topic: '
                          f'{", ".join(names)}')
    kinds = sorted({channel.msgtype for channel in chosen if channel.count})
    if len(kinds) > 1:
        raise SourceError(f'{path} has messages of {" and ".join(kinds)} on {chosen[0].topic}; '
                          'a topic has one type: split the bag, or record one of them')
    if not kinds:
        raise SourceError(f'{path} has no message on {chosen[0].topic}; record some images')
    return ImageTopic(chosen[0].topic, kinds[0],
                      tuple(channel for channel in chosen if channel.msgtype == kinds[0]))


def decode_image(reader: BagReader, data: bytes, msgtype: str) -> tuple[int, npt.NDArray]:
    """
    Return header stamp, in nanoseconds, and pixels of a serialized image.

    Raises
    ------
    ValueError
        When it cannot be decoded; says why.

    """
    # Folders and videos are read through the same door, and need no messages.
    from msg_adapters.compressed import image_from_compressed
    from msg_adapters.errors import MessageError
    from msg_adapters.image import image_from_message

    try:
        message = reader.deserialize(data, msgtype)
        stamp = header_stamp(message)
        return stamp, (image_from_message if msgtype == RAW else image_from_compressed)(message)
    except MessageError:
        raise
    # A damaged message fails in as many ways as it has bytes.
    except Exception as error:  # noqa: B902
        raise ValueError(f'the message is damaged ({type(error).__name__}: {error}); '
                         'record it again') from error


class BagImages:
    """
    Frames of one image topic of a bag, in the order of recording.

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
            images = choose_topic(reader, path, topic)
            seconds = (reader.end - reader.begin) * 1e-9
        self.topic = images.name
        self._length = len(images)
        fps = (self._length - 1) / seconds if seconds > 0 else 0.0
        self.fps = fps if 0.1 <= fps <= 1000 else _DEFAULT_FPS

    def __len__(self) -> int:
        """Return the number of messages on the topic."""
        return self._length

    def __iter__(self) -> Iterator[RecordedFrame]:
        """
        Yield the frames with the stamps of `ImageStamps`, numbered by their messages.

        Images that cannot be decoded are left out, and a `SourceWarning` says which and why.

        Raises
        ------
        SourceError
            When no image can be decoded.

        """
        place = f'on {self.topic} of {self._path}'
        skipped, stamps = SkippedImages(place), ImageStamps(place)
        with open_bag(self._path) as reader:
            images = choose_topic(reader, self._path, self.topic)
            for index, (_, logged, data) in enumerate(reader.messages(images.channels)):
                try:
                    header, image = decode_image(reader, data, images.msgtype)
                except ValueError as error:
                    skipped.add(index, error)
                    continue
                yield RecordedFrame(index, stamps.take(header, logged), image)
        skipped.finish(len(images))


class SkippedImages:
    """
    Account of the images that cannot be decoded.

    Parameters
    ----------
    place : str
        Where they are, for what is told: `on /image_raw of flight`.

    """

    def __init__(self, place: str) -> None:
        self._place = place
        self._count = 0
        self._first: ValueError | None = None

    def add(self, index: int, error: ValueError) -> None:
        """
        Note that image `index` is left out; the first ones are told one by one.

        Raises
        ------
        SourceError
            When the bag begins with so many of them that it must be the camera.

        """
        self._first = self._first or error
        self._count += 1
        if self._count == index + 1 == _HOPELESS:
            raise SourceError(f'none of the first {_HOPELESS} images {self._place} can be '
                              f'decoded: {self._first}') from self._first
        if self._count <= _SKIPPED_TOLD:
            _tell(f'image {index} {self._place} is left out: {error}')

    def finish(self, total: int) -> None:
        """
        Tell how many were left out of `total`.

        Raises
        ------
        SourceError
            When all were.

        """
        if self._first is not None and self._count >= total:
            raise SourceError(f'no image {self._place} can be decoded: '
                              f'{self._first}') from self._first
        if self._count > _SKIPPED_TOLD:
            _tell(f'{self._count} of {total} images {self._place} were left out')


def _tell(message: str) -> None:
    warnings.warn(message, SourceWarning, stacklevel=1)
