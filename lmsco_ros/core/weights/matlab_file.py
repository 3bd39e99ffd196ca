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

"""MATLAB files of level 5, unfolded within bounds and seen to hold what they declare."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
import math
import struct
import zlib

__all__ = ['FileTooLarge', 'unfold']

_HEADER = 128
_ORDERS = {b'IM': '<', b'MI': '>'}

# Types of elements, and classes of arrays, by their numbers in the format.
_NAMES = (1, 16)
_INT32, _MATRIX, _COMPRESSED = 5, 14, 15
_CELL, _STRUCT, _OBJECT, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 5, 16, 17
_FLAGS = (6, 8)
_COMPLEX = 0x800
_NUMBERS_AND_TEXT = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18}

# Far more than any network has; each part costs some hundred bytes of memory.
_MOST_PARTS = 100_000
_DEEPEST = 30

_Element = tuple[int, memoryview]


class FileTooLarge(ValueError):
    """A file holds more than is read."""


def unfold(content: bytes, limit: int) -> BytesIO:
    """
    Return a file, open at its beginning, with its compressed parts unfolded.

    Parameters
    ----------
    content : bytes
        A file of level 5, as MATLAB has saved it up to version 7 (options -v6 and -v7).
    limit : int
        Bytes at most.

    Raises
    ------
    FileTooLarge
        When it unfolds to more than the limit, or to more parts than a network has.
    ValueError
        When the file is of another kind, or declares more than it holds.

    """
    order = _ORDERS.get(content[126:_HEADER])
    if order is None:
        raise ValueError('it has no header of a MATLAB file of level 5')
    unfolded, most = BytesIO(), _MOST_PARTS
    unfolded.write(content[:_HEADER])
    for kind, body in _elements(memoryview(content)[_HEADER:], order, aligned=False):
        part = (_inflate(body, limit - unfolded.tell()) if kind == _COMPRESSED
                else struct.pack(order + 'II', kind, len(body)) + body)
        if len(part) < 8 or len(part) != 8 + struct.unpack_from(order + 'II', part)[1]:
            raise ValueError('a variable is not as long as it declares')
        most -= _count_parts(memoryview(part), order, most)
        unfolded.write(part)
    unfolded.seek(0)
    return unfolded


def _inflate(body: memoryview, limit: int) -> bytes:
    """Return what a compressed element holds."""
    part = zlib.decompressobj().decompress(body, max(limit, 0) + 1)
    if len(part) > limit:
        raise FileTooLarge('it unfolds to more')
    return part


def _elements(data: memoryview, order: str, aligned: bool = True) -> Iterator[_Element]:
    """Give type and content of each element in turn."""
    while len(data):
        kind, size = struct.unpack_from(order + 'II', data)
        start = 8
        if kind >> 16:
            # Up to four bytes stand in the place of their number.
            kind, size, start = kind & 0xffff, kind >> 16, 4
        if start + size > len(data) or start == 4 and size > 4:
            raise ValueError(f'an element of {size} bytes ends beyond its surroundings')
        yield kind, data[start:start + size]
        end = 8 if start == 4 else start + size
        data = data[end + (-end % 8 if aligned else 0):]


def _count_parts(data: memoryview, order: str, most: int) -> int:
    """Return how many arrays there are, however deep; all have room for what they declare."""
    waiting, count = [(data, 0)], 0
    while waiting:
        data, depth = waiting.pop()
        for kind, body in _elements(data, order):
            if kind != _MATRIX or not len(body):
                continue
            count += 1
            if count > most or depth >= _DEEPEST:
                raise FileTooLarge(f'it has more than {_MOST_PARTS} parts, or parts in parts '
                                   f'more than {_DEEPEST} deep')
            _check_array(list(_elements(body, order)), len(body), order)
            waiting.append((body, depth + 1))
    return count


def _check_array(elements: list[_Element], size: int, order: str) -> None:
    """Raise unless an array of `size` bytes has the parts and the room that it declares."""
    if (elements[0][0], len(elements[0][1])) != _FLAGS:
        raise ValueError('an array does not begin with its class')
    flags, = struct.unpack_from(order + 'I', elements[0][1])
    array_class = flags & 0xff
    if not _CELL <= array_class <= _OPAQUE:
        raise ValueError(f'an array is of the unknown class {array_class}')
    if array_class == _OPAQUE:
        return
    if array_class not in (_CELL, _STRUCT, _OBJECT, _FUNCTION):
        # SciPy takes whatever follows for numbers, and may crash over it.
        least = 3 + (3 if array_class == _SPARSE else 1) + bool(flags & _COMPLEX)
        if len(elements) < least or {kind for kind, _ in elements} - _NUMBERS_AND_TEXT:
            raise ValueError('an array lacks its numbers')
    (kind, body), (name_kind, _) = elements[1:3]
    if kind != _INT32 or name_kind not in _NAMES or len(body) < 8 or len(body) % 4:
        raise ValueError('an array has no dimensions or no name')
    dimensions = struct.unpack(f'{order}{len(body) // 4}i', body)
    number = math.prod(dimensions)
    if array_class in (_STRUCT, _OBJECT):
        number *= max(1, _field_count(elements[3 if array_class == _STRUCT else 4:], order))
    if min(dimensions, default=0) < 0 or number > size and array_class != _SPARSE:
        raise ValueError(f'an array of {size} bytes declares the dimensions {dimensions}')


def _field_count(elements: list[_Element], order: str) -> int:
    """Return the number of fields of a structure, from the length of a name and all names."""
    length, = struct.unpack_from(order + 'i', elements[0][1])
    return len(elements[1][1]) // length if length > 0 else 0
