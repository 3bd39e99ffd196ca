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

"""
Bags, read without ROS and however they were left.

Each storage file is read by itself, by rosbags where it can. A file that its recorder did not
finish, or that was damaged, is read as far as it goes, and a `SourceWarning` says so.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, ExitStack
import heapq
from itertools import chain
from pathlib import Path
import warnings

from backports import zstd
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.replay.bags.channel import Channel, StorageReader
from lmsco_ros.replay.bags.files import find_files, ROS1, storage_suffix
from lmsco_ros.replay.bags.part import BagPart
from lmsco_ros.replay.bags.unpacking import plain_file
from lmsco_ros.replay.errors import SourceError, SourceWarning

_ZSTD_START = b'\x28\xb5\x2f\xfd'
_MOST_UNPACKED = 2 ** 29
_LATEST = 2 ** 63 - 1


class BagReader:
    """
    An open bag.

    Parameters
    ----------
    files : sequence of StorageReader
        Its files.
    is_ros1 : bool
        Whether messages are serialized as ROS 1 does it.

    Attributes
    ----------
    channels : list of Channel
        What there is to read.
    begin, end : int
        Times of recording of the first and the last message, in nanoseconds; 0 without any.

    """

    def __init__(self, files: Sequence[StorageReader], *, is_ros1: bool = False) -> None:
        self._files = files
        self.is_ros1 = is_ros1
        self._types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_JAZZY)
        self.channels = list(chain.from_iterable(file.channels for file in files))
        filled = [file for file in files if any(channel.count for channel in file.channels)]
        self.begin = _clamped(min((file.begin for file in filled), default=0))
        self.end = _clamped(max((file.end for file in filled), default=0))

    def messages(self, channels: Collection[Channel] = (), start: int | None = None,
                 ) -> Iterator[tuple[Channel, int, bytes]]:
        """
        Yield channel, time of recording in nanoseconds, and serialized message.

        They come in the order of recording; by default all of them, else those of some
        channels, or from `start` on.
        """
        wanted = set(channels or self.channels)
        parts = [file.messages(wanted, start) for file in self._files]
        for channel, logged, data in heapq.merge(*parts, key=lambda item: item[1]):
            if start is None or logged >= start:
                yield channel, _clamped(logged), _unpacked(data)

    def deserialize(self, data: bytes, msgtype: str) -> object:
        """Return a message of a type that ROS has."""
        if self.is_ros1:
            return self._types.deserialize_ros1(data, msgtype)
        return self._types.deserialize_cdr(data, msgtype)


@contextmanager
def open_bag(path: Path) -> Iterator[BagReader]:
    """
    Open a bag for reading.

    Parameters
    ----------
    path : Path
        Folder of a rosbag2, or a storage file: mcap, db3, or the bag of ROS 1.

    Raises
    ------
    SourceError
        When it is no bag, or nothing of it can be read.

    """
    found = find_files(path)
    with ExitStack() as stack:
        files, errors = [], []
        for file in found.files:
            try:
                part = BagPart(file, plain_file(file, stack), found.digests)
            except SourceError as error:
                errors.append(str(error))
            except OSError as error:
                errors.append(f'{file} cannot be read ({error.strerror or error})')
            else:
                stack.callback(part.close)
                files.append(part)
        if not files:
            raise SourceError('; '.join(errors))
        for words in errors:
            _tell(f'{words}; the other files of {path} are read')
        yield BagReader(files, is_ros1=storage_suffix(found.files[0]) == ROS1)


def _unpacked(data: bytes) -> bytes:
    """Return a message that the recorder may have compressed; none begins so otherwise."""
    if data[:4] != _ZSTD_START:
        return data
    decompressor = zstd.ZstdDecompressor()
    try:
        unpacked = decompressor.decompress(data, _MOST_UNPACKED)
    except zstd.ZstdError:
        return data
    # Whoever wants to read a message that is damaged, or unfolds without an end, will see it.
    return unpacked if decompressor.eof else data


def _clamped(logged: int) -> int:
    """Return a time of recording that every storage can hold."""
    return min(max(logged, 0), _LATEST)


def _tell(message: str) -> None:
    warnings.warn(message, SourceWarning, stacklevel=1)
