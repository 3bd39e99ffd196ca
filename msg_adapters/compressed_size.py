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

"""Size of a compressed image from its first bytes, before memory is spent on its pixels."""

from __future__ import annotations

PNG_START, JPEG_START = b'\x89PNG', b'\xff\xd8'
_JPEG_START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def declared_size(data: memoryview) -> tuple[int, int] | None:
    """
    Return (width, height) as the head of a jpeg or png file tells it.

    Parameters
    ----------
    data : memoryview of bytes
        The file.

    Returns
    -------
    (int, int) or None
        In pixels; None when the head is not one of these or incomplete.

    """
    if data[:4] == PNG_START:
        return _png_size(data)
    return _jpeg_size(data) if data[:2] == JPEG_START else None


def _png_size(data: memoryview) -> tuple[int, int] | None:
    # The first chunk, IHDR, begins with both numbers.
    if len(data) < 24:
        return None
    return int.from_bytes(data[16:20], 'big'), int.from_bytes(data[20:24], 'big')


def _jpeg_size(data: memoryview) -> tuple[int, int] | None:
    position = len(JPEG_START)
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker in _JPEG_START_OF_FRAME:
            return (int.from_bytes(data[position + 7:position + 9], 'big'),
                    int.from_bytes(data[position + 5:position + 7], 'big'))
        if marker == 0xFF:
            position += 1
        else:
            position += 2 + int.from_bytes(data[position + 2:position + 4], 'big')
    return None
