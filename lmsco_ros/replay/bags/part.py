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

"""Storage files however they were left."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
import warnings

from lmsco_ros.replay.bags.channel import Channel, RecoveredReader, StorageReader
from lmsco_ros.replay.bags.files import MCAP, ROS1, SQLITE, storage_suffix
from lmsco_ros.replay.bags.intact import IntactFile
from lmsco_ros.replay.bags.mcap_recovery import RecoveredMcap
from lmsco_ros.replay.bags.sqlite_recovery import RecoveredSqlite
from lmsco_ros.replay.errors import SourceError, SourceWarning

_RECOVERY: Mapping[str, Callable[[Path], RecoveredReader]] = {
    MCAP: RecoveredMcap, SQLITE: RecoveredSqlite}
_REMEDY = {MCAP: 'repair it with "mcap recover {0} -o repaired.mcap"',
           SQLITE: 'repair it with "sqlite3 {0} .recover | sqlite3 repaired.db3"',
           ROS1: 'repair it with "rosbag reindex {0}"'}
_LOSSES_TOLD = 2


class BagPart:
    """
    One storage file of a bag, a `StorageReader`.

    It is read by rosbags as long as that can, and from there on by what recovers the rest; a
    `SourceWarning` says so.

    Parameters
    ----------
    file : Path
        The file as the user knows it.
    path : Path
        What is read: the file, or a copy that is unpacked.
    digests : mapping
        Digests of message types that the file itself does not have.

    Raises
    ------
    SourceError
        When nothing of it can be read.

    """

    def __init__(self, file: Path, path: Path, digests: Mapping[tuple[str, str], str]) -> None:
        self._file, self._path = file, path
        self._suffix = storage_suffix(file)
        self._remedy = _REMEDY[self._suffix].format(file)
        self._reader: StorageReader
        try:
            self._reader = IntactFile(path, digests)
        # Readers fail in many ways on damaged storage, none of which is ours to tell apart.
        except Exception as error:  # noqa: B902
            self._reader = self._recovered(error)
        self.channels = self._reader.channels
        self.begin, self.end = self._reader.begin, self._reader.end

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def messages(self, channels: Collection[Channel], start: int | None = None,
                 ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of recording and serialized message, in the order of time."""
        given = array('q')
        try:
            for channel, logged, data in self._reader.messages(channels, start):
                given.append(hash((channel.topic, logged)))
                yield channel, logged, data
            self._tell_missing(channels, len(given) if start is None else None)
            return
        except Exception as error:  # noqa: B902
            if not isinstance(self._reader, IntactFile):
                raise
            reason = error
        yield from self._rest(channels, Counter(given), reason)

    def _rest(self, channels: Collection[Channel], given: Counter[int], reason: Exception,
              ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield what there is behind a damaged place."""
        try:
            recovered = self._recovered(reason)
        except SourceError as error:
            _tell(str(error))
            return
        named = {(channel.topic, channel.msgtype): channel for channel in channels}
        wanted = {channel: named[channel.topic, channel.msgtype]
                  for channel in recovered.channels
                  if (channel.topic, channel.msgtype) in named}
        try:
            for channel, logged, data in recovered.messages(wanted):
                key = hash((channel.topic, logged))
                if given[key]:
                    given[key] -= 1
                else:
                    yield wanted[channel], logged, data
        finally:
            recovered.close()

    def _tell_missing(self, channels: Collection[Channel], given: int | None) -> None:
        """Tell when `given` messages were read, and the file counts more."""
        stated = sum(channel.count for channel in self.channels if channel in channels)
        if given is not None and given < stated:
            _tell(f'{self._file} is damaged: of {stated} messages {given} can be read; '
                  f'{self._remedy}')

    def _recovered(self, error: Exception) -> RecoveredReader:
        """Return a reader of what is left of the file."""
        reason = ' '.join(str(error).split()).rstrip('.') or type(error).__name__
        if self._suffix not in _RECOVERY:
            raise SourceError(f'{self._file} is damaged ({reason}); {self._remedy}') from error
        try:
            recovered = _RECOVERY[self._suffix](self._path)
        except (SourceError, OSError) as problem:
            raise SourceError(f'{self._file} is damaged and cannot be read ({reason}; '
                              f'{problem}); {self._remedy}, or record it again') from error
        count = sum(channel.count for channel in recovered.channels)
        if recovered.losses:
            losses = '; '.join([reason, *recovered.losses[:_LOSSES_TOLD]])
            _tell(f'{self._file} is damaged or was not finished ({losses}): '
                  f'{count} messages can be read; {self._remedy}')
        return recovered


def _tell(message: str) -> None:
    warnings.warn(message, SourceWarning, stacklevel=1)
