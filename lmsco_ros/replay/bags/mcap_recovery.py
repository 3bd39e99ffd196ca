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
What can be read of an mcap file that its recorder did not finish, or that was damaged.

The file is read record by record, without its index
(https://mcap.dev/spec#records). What a recorder that was killed leaves ends in the middle of a
record; of a chunk that is cut or damaged, the messages in front of that place are read.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
import heapq
from pathlib import Path
import re
import struct
from zlib import crc32

from backports import zstd
from lz4.frame import LZ4FrameDecompressor

from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.errors import SourceError

_MAGIC = b'\x89MCAP0\r\n'
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 2, 3, 4, 5, 6
_HEAD, _MESSAGE_HEAD = struct.Struct('<BQ'), struct.Struct('<HIQQ')
_CHUNK_HEAD = struct.Struct('<QQQII')
_BLOCK, _PIECE, _MOST_UNFOLDED = 2 ** 20, 2 ** 12, 2 ** 30
# Chunks are found again behind a damaged place by what they begin with: length, times, size,
# checksum and compression.
_CHUNK_START = re.compile(
    rb'\x06.{5}\0\0\0.{28}(?:\0\0\0\0|\x04\0\0\0zstd|\x03\0\0\0lz4).{5}\0\0\0', re.DOTALL)
_LONGEST_START = 60


@dataclass(frozen=True)
class _Span:
    """Messages that stand together: a chunk, or what lies between chunks."""

    position: int
    length: int
    is_chunk: bool
    begin: int


class RecoveredMcap:
    """
    The messages of a damaged mcap file, a `StorageReader`.

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
        When it is no mcap file.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._size = path.stat().st_size
        self.losses: list[str] = []
        self.begin, self.end = 2 ** 63 - 1, 0
        self._schemas: dict[int, tuple[str, str]] = {0: ('', '')}
        self._described: dict[int, Channel] = {}
        self._counts: dict[int, int] = {}
        self._spans: list[_Span] = []
        self._stream = path.open('rb')
        try:
            if self._stream.read(len(_MAGIC)) != _MAGIC:
                raise SourceError(f'{path} does not begin as an mcap file does')
            self._scan()
        except BaseException:
            self.close()
            raise
        self._by_id = {key: Channel(item.topic, item.msgtype, self._counts.get(key, 0),
                                    item.definition, serialization=item.serialization)
                       for key, item in self._described.items()}
        self.channels = list(self._by_id.values())

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def messages(self, channels: Collection[Channel], start: int | None = None,
                 ) -> Iterator[tuple[Channel, int, bytes]]:
        """Yield channel, time of recording and serialized message, in the order of time."""
        # Messages wait until no later span can begin before them; the count keeps the order
        # of the file where times are equal.
        waiting: list[tuple[int, int, Channel, bytes]] = []
        count = 0
        for span in sorted(self._spans, key=lambda span: span.begin):
            while waiting and waiting[0][0] < span.begin:
                logged, _, channel, data = heapq.heappop(waiting)
                yield channel, logged, data
            for channel, logged, data in self._messages_in(span):
                if channel in channels:
                    heapq.heappush(waiting, (logged, count, channel, data))
                    count += 1
        while waiting:
            logged, _, channel, data = heapq.heappop(waiting)
            yield channel, logged, data

    def _messages_in(self, span: _Span) -> Iterator[tuple[Channel, int, bytes]]:
        content, _ = self._load(span.position, span.length, span.is_chunk)
        for operation, start, end in _records(content):
            if operation == _MESSAGE and end - start >= _MESSAGE_HEAD.size:
                key, _, logged, _ = _MESSAGE_HEAD.unpack_from(content, start)
                if key in self._by_id:
                    yield self._by_id[key], logged, content[start + _MESSAGE_HEAD.size:end]

    def _scan(self) -> None:
        """Go through the records and note where messages are."""
        position = loose = len(_MAGIC)
        while position < self._size:
            operation, end = self._record_at(position)
            if operation in (_SCHEMA, _CHANNEL, _MESSAGE) and end - loose < _BLOCK:
                position = end
                continue
            if operation in (_SCHEMA, _CHANNEL, _MESSAGE):
                self._note(loose, end, is_chunk=False)
            else:
                self._note(loose, position, is_chunk=False)
            if operation == _FOOTER:
                return
            if operation == _CHUNK:
                self._note(position + _HEAD.size, end, is_chunk=True)
            if end > self._size or not operation:
                self.losses.append(f'there is no whole record at byte {position}')
                end = self._next_chunk(position + 1)
            position = loose = end
        self._note(loose, position, is_chunk=False)
        self.losses.append('its end is missing')

    def _record_at(self, position: int) -> tuple[int, int]:
        """Return kind and end of a record; kind 0 where there is none that can be used."""
        self._stream.seek(position)
        head = self._stream.read(_HEAD.size)
        if len(head) < _HEAD.size:
            return 0, self._size
        operation, length = _HEAD.unpack(head)
        end = position + _HEAD.size + length
        # Of a chunk, the beginning is worth something, too.
        return (operation if end <= self._size or operation == _CHUNK else 0), end

    def _next_chunk(self, position: int) -> int:
        """Return where the next chunk begins behind a damaged place, or the end of the file."""
        while position < self._size:
            self._stream.seek(position)
            block = self._stream.read(_BLOCK + _LONGEST_START)
            for match in _CHUNK_START.finditer(block):
                length = _HEAD.unpack_from(block, match.start())[1]
                start = position + match.start()
                stored, = struct.unpack_from('<Q', block, match.end() - 8)
                used = match.end() - match.start() - _HEAD.size + stored
                if used == length and start + _HEAD.size + length <= self._size:
                    return start
            position += _BLOCK
        return self._size

    def _note(self, position: int, end: int, *, is_chunk: bool) -> None:
        """Take in a span: its channels, and from when its messages are."""
        length = min(end, self._size) - position
        if length <= 0:
            return
        content, loss = self._load(position, length, is_chunk)
        begin, reached = None, 0
        for operation, start, reached in _records(content):
            body = content[start:reached]
            try:
                if operation == _SCHEMA:
                    self._add_schema(body)
                elif operation == _CHANNEL:
                    self._add_channel(body)
                elif operation == _MESSAGE:
                    key, _, logged, _ = _MESSAGE_HEAD.unpack_from(body)
                    self._counts[key] = self._counts.get(key, 0) + 1
                    begin = logged if begin is None else min(begin, logged)
                    self.begin, self.end = min(self.begin, logged), max(self.end, logged)
            except (struct.error, ValueError, KeyError):
                loss = loss or 'has a damaged record'
        if loss or reached < len(content):
            self.losses.append(f'the chunk at byte {position} {loss or "breaks off"}')
        if begin is not None:
            self._spans.append(_Span(position, length, is_chunk, begin))

    def _add_schema(self, body: bytes) -> None:
        key, = struct.unpack_from('<H', body)
        name, at = _text(body, 2)
        encoding, at = _text(body, at)
        definition, _ = _text(body, at)
        self._schemas[key] = (name, definition if encoding in ('ros2msg', 'ros2idl') else '')

    def _add_channel(self, body: bytes) -> None:
        key, schema = struct.unpack_from('<HH', body)
        topic, at = _text(body, 4)
        serialization, _ = _text(body, at)
        name, definition = self._schemas[schema]
        self._described[key] = Channel(topic, name, 0, definition, serialization=serialization)

    def _load(self, position: int, length: int, is_chunk: bool) -> tuple[bytes, str]:
        """Return records as far as they can be read, and what is wrong with the rest."""
        self._stream.seek(position)
        content = self._stream.read(length)
        return _unfolded(content) if is_chunk else (content, '')


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield kind, start and end of each whole record."""
    position = 0
    while position + _HEAD.size <= len(content):
        operation, length = _HEAD.unpack_from(content, position)
        start = position + _HEAD.size
        position = start + length
        if position > len(content):
            return
        yield operation, start, position


def _text(body: bytes, position: int) -> tuple[str, int]:
    """Return a text with its length in front, and the position behind it."""
    length, = struct.unpack_from('<I', body, position)
    end = position + 4 + length
    if end > len(body):
        raise ValueError('text is cut')
    return body[position + 4:end].decode(), end


def _unfolded(chunk: bytes) -> tuple[bytes, str]:
    """Return the records of a chunk as far as they can be read, and what is wrong with it."""
    try:
        _, _, size, checksum, _ = _CHUNK_HEAD.unpack_from(chunk)
        compression, at = _text(chunk, _CHUNK_HEAD.size - 4)
        stored, = struct.unpack_from('<Q', chunk, at)
    except (struct.error, ValueError):
        return b'', 'has no head'
    content = chunk[at + 8:at + 8 + stored]
    if compression:
        content = _decompressed(content, compression)
    if len(content) != size:
        return content, f'has {len(content)} of {size} bytes'
    if checksum and crc32(content) != checksum:
        return content, 'has another checksum than was noted'
    return content, ''


def _decompressed(content: bytes, compression: str) -> bytes:
    """Return what is unfolded before the first damaged place."""
    decompressor = {'zstd': zstd.ZstdDecompressor, 'lz4': LZ4FrameDecompressor}.get(compression)
    if decompressor is None:
        return b''
    unfold, unfolded = decompressor(), bytearray()
    try:
        for start in range(0, len(content), _PIECE):
            unfolded += unfold.decompress(content[start:start + _PIECE], _MOST_UNFOLDED)
            if len(unfolded) >= _MOST_UNFOLDED:
                break
    # The two libraries raise different errors on damaged data.
    except Exception:  # noqa: B902
        pass
    return bytes(unfolded)
