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

"""Storage files as rosbags reads them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader

from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.bags.files import ROS1, storage_suffix


class IntactFile:
    """
    A storage file through rosbags, a `StorageReader`.

    Parameters
    ----------
    path : Path
        The file.
    digests : mapping
        Digests of message types that the file itself does not have.

    """

    def __init__(self, path: Path, digests: Mapping[tuple[str, str], str]) -> None:
        reader = Ros1Reader(path) if storage_suffix(path) == ROS1 else Ros2Reader(path)
        reader.open()
        self._reader = reader
        self._connections = {_channel(item, digests): item for item in reader.connections}
        self.channels = list(self._connections)
        # The end of rosbags is just behind the last message.
        self.begin, self.end = reader.start_time, reader.end_time - 1

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def messages(self, channels: Collection[Channel], start: int | None = None,
                 ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of recording and serialized message, in the order of time."""
        wanted = {item.id: channel for channel, item in self._connections.items()
                  if channel in channels}
        if wanted:
            connections = [self._connections[channel] for channel in wanted.values()]
            for connection, logged, data in self._reader.messages(connections, start):
                yield wanted[connection.id], logged, data


def _channel(connection: Connection, digests: Mapping[tuple[str, str], str]) -> Channel:
    topic, msgtype = connection.topic, connection.msgtype
    return Channel(
        topic, msgtype, connection.msgcount, connection.msgdef.data,
        connection.digest or digests.get((topic, msgtype), ''),
        getattr(connection.ext, 'serialization_format', ''),
        tuple(getattr(connection.ext, 'offered_qos_profiles', ())))
