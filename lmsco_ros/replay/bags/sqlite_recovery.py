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

"""What can be read of an sqlite3 storage file that was damaged or cut."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
import sqlite3
from urllib.parse import quote

from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.errors import SourceError

# Each way through the table ends where it meets damage; together they reach what is behind it.
_WAYS = ('SELECT id FROM messages ORDER BY timestamp',
         'SELECT id FROM messages ORDER BY timestamp DESC',
         'SELECT id FROM messages ORDER BY id',
         'SELECT id FROM messages ORDER BY id DESC')


class RecoveredSqlite:
    """
    The messages of a damaged sqlite3 file, a `StorageReader`.

    Parameters
    ----------
    path : Path
        The file.

    Attributes
    ----------
    losses : list of str
        What is wrong with it; empty when every message could be read.

    Raises
    ------
    SourceError
        When not even its topics can be read.

    """

    def __init__(self, path: Path) -> None:
        self.losses: list[str] = []
        self._database = sqlite3.connect(f'file:{quote(str(path.resolve()))}?immutable=1',
                                         uri=True)
        self._database.text_factory = lambda text: text.decode(errors='replace')
        try:
            # Without this, sqlite3 reads nothing of a file that is shorter than it was.
            self._database.execute('PRAGMA writable_schema = ON')
            topics = self._topics()
            self._rows = self._find_rows(topics)
        except sqlite3.Error as error:
            self.close()
            raise SourceError(f'{path} has no topics that can be read ({error})') from error
        except BaseException:
            self.close()
            raise
        counts = dict.fromkeys(topics, 0)
        for _, _, key in self._rows:
            counts[key] += 1
        self._by_id = {
            key: Channel(item.topic, item.msgtype, counts[key], item.definition,
                         serialization=item.serialization) for key, item in topics.items()}
        self.channels = list(self._by_id.values())
        self.begin = self._rows[0][0] if self._rows else 0
        self.end = self._rows[-1][0] if self._rows else 0

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def messages(self, channels: Collection[Channel], start: int | None = None,
                 ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of recording and serialized message, in the order of time."""
        for logged, number, key in self._rows:
            if self._by_id[key] in channels:
                row = self._row(number)
                if row is not None:
                    yield self._by_id[key], logged, row[2]

    def _topics(self) -> dict[int, Channel]:
        definitions: dict[str, str] = {}
        try:
            definitions.update(self._database.execute(
                'SELECT topic_type, encoded_message_definition FROM message_definitions'))
        except sqlite3.Error:
            # Older bags have none, and images are read without.
            pass
        rows = self._database.execute('SELECT id, name, type, serialization_format FROM topics')
        return {key: Channel(topic, msgtype, 0, definitions.get(msgtype, ''),
                             serialization=serialization)
                for key, topic, msgtype, serialization in rows
                if isinstance(topic, str) and isinstance(msgtype, str)}

    def _find_rows(self, topics: dict[int, Channel]) -> list[tuple[int, int, int]]:
        """Return time, number and topic of the messages that can be read, by time."""
        numbers: set[int] = set()
        for way in _WAYS:
            numbers.update(self._as_far_as_possible(way))
        rows = []
        for number in sorted(numbers):
            row = self._row(number)
            if row is not None and row[1] in topics:
                rows.append((row[0], number, row[1]))
        if len(rows) < len(numbers):
            self.losses.append(f'messages that are damaged: {len(numbers) - len(rows)}')
        return sorted(rows)

    def _as_far_as_possible(self, query: str) -> Iterator[int]:
        try:
            for number, in self._database.execute(query):
                yield number
        except sqlite3.Error as error:
            if str(error) not in self.losses:
                self.losses.append(str(error))

    def _row(self, number: int) -> tuple[int, int, bytes] | None:
        """Return time, topic and data of a message, None when it is damaged."""
        try:
            row = self._database.execute(
                'SELECT timestamp, topic_id, data FROM messages WHERE id = ?',
                (number,)).fetchone()
        except sqlite3.Error:
            return None
        if row is None or not isinstance(row[0], int) or not isinstance(row[2], bytes):
            return None
        return row
