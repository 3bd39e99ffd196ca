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

"""Stamps of images, in nanoseconds: read, mended, written."""

from __future__ import annotations

import struct
from typing import Any
import warnings

from lmsco_ros.replay.errors import SourceWarning

_NANOSECONDS = 1_000_000_000
# builtin_interfaces/Time ends in 2038.
END_OF_TIME = 2 ** 31 * _NANOSECONDS
# Room for images that share the latest stamp.
_LATEST = END_OF_TIME - _NANOSECONDS
_UNTIMED_PERIOD = _NANOSECONDS // 30


def header_stamp(message: Any) -> int:
    """Return the stamp of a message's header, in nanoseconds."""
    return message.header.stamp.sec * _NANOSECONDS + message.header.stamp.nanosec


def serialized_stamp(data: bytes) -> int:
    """Return the header stamp, in nanoseconds, of a serialized message that has one."""
    seconds, nanoseconds = struct.unpack_from(_layout(data), data, 4)
    return seconds * _NANOSECONDS + nanoseconds


def with_stamp(data: bytes, stamp: int) -> bytes:
    """Return a serialized message with another header stamp."""
    return data[:4] + struct.pack(_layout(data), *divmod(stamp, _NANOSECONDS)) + data[12:]


def is_usable(stamp: int) -> bool:
    """Tell whether a stamp says when something was: a clock before 1970 was never set."""
    return 0 < stamp <= _LATEST


def _layout(data: bytes) -> str:
    return f'{"<" if data[1] & 1 else ">"}iI'


class ImageStamps:
    """
    The stamps of the images of a topic, each of them usable and different from the others.

    Where the header has none (0, before 1970, or more than builtin_interfaces/Time holds), the
    time of recording takes its place, and where this is none either, 1/30 s after the image
    before. An image whose stamp was there before gets the next nanosecond that is free. Each
    kind of mending is told once, by a `SourceWarning`.

    Parameters
    ----------
    place : str
        Where the images are, for what is told: `on /image_raw of flight`.

    """

    def __init__(self, place: str) -> None:
        self._place = place
        self._last = 0
        self._told: set[str] = set()
        # Where to look for a free nanosecond, for each stamp that was asked for or given.
        self._free: dict[int, int] = {}

    def take(self, header: int, logged: int) -> int:
        """
        Return the stamp of the next image.

        Parameters
        ----------
        header, logged : int
            Stamp of the header and time of recording, in nanoseconds.

        """
        wanted = stamp = self._usable(header, logged)
        while stamp in self._free:
            stamp = self._free[stamp]
        if stamp != wanted:
            self._tell('share stamps; each of them comes a nanosecond after the one before')
        elif stamp < self._last:
            self._tell('have stamps that go back; they are read in the order of recording')
        self._free[stamp] = self._free[wanted] = stamp + 1
        self._last = stamp
        return stamp

    def _usable(self, header: int, logged: int) -> int:
        """Return a time for the image that can be written into a message."""
        if is_usable(header):
            return header
        if is_usable(logged):
            self._tell('have no stamp; the time of recording takes its place')
            return logged
        self._tell('have neither stamp nor time of recording; each comes 1/30 s after the one '
                   'before')
        return self._last + _UNTIMED_PERIOD

    def _tell(self, words: str) -> None:
        if words not in self._told:
            self._told.add(words)
            warnings.warn(f'images {self._place} {words}', SourceWarning, stacklevel=1)
