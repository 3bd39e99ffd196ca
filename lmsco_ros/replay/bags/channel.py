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

"""What a storage file holds, whoever reads it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from rosbags.interfaces import Qos


@dataclass(frozen=True, eq=False)
class Channel:
    """
    One stream of messages in one file; a topic may have several.

    Attributes
    ----------
    topic, msgtype : str
        Such as /image_raw and sensor_msgs/msg/Image.
    count : int
        Messages in it.
    definition, digest : str
        Of the message type; empty when the file does not say.
    serialization : str
        How messages are written, in general `cdr`.
    qos : tuple of Qos
        Quality of service that was offered.

    """

    topic: str
    msgtype: str
    count: int
    definition: str = ''
    digest: str = ''
    serialization: str = 'cdr'
    qos: tuple[Qos, ...] = ()


class StorageReader(Protocol):
    """An open storage file."""

    @property
    def channels(self) -> Sequence[Channel]:
        """What there is to read."""

    @property
    def begin(self) -> int:
        """When the first message was recorded, in nanoseconds."""

    @property
    def end(self) -> int:
        """When the last message was recorded, in nanoseconds."""

    def messages(self, channels: Collection[Channel], start: int | None = None,
                 ) -> Iterator[tuple[Channel, int, bytes]]:
        """
        Yield channel, time of recording and serialized message, in the order of time.

        Messages before `start`, in nanoseconds, may be left out.
        """

    def close(self) -> None:
        """Close the file."""


class RecoveredReader(StorageReader, Protocol):
    """A storage file that is damaged, read as far as it goes."""

    @property
    def losses(self) -> Sequence[str]:
        """What is wrong with it; empty when every message can be read."""
