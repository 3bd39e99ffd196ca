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
Size and number of scans of a jpeg file (ITU-T T.81, Annex B).

Everything is skipped as libjpeg does it, so that both see the same size and the same scans; what
libjpeg does not know is refused.
"""

from __future__ import annotations

import re

from msg_adapters.errors import ImageMessageError
from msg_adapters.image_file import ImageFile

__all__ = ['JPEG_START', 'read_jpeg']

JPEG_START = b'\xff\xd8\xff'

# The next marker with something to read: data and filling bytes in front of it, stuffed zeros and
# the markers that stand alone (RSTn, TEM) mean nothing here.
_MARKER = re.compile(rb'\xff[^\x00\x01\xd0-\xd7\xff]')
_START_OF_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
# Baseline, extended and progressive, with Huffman codes.
_READABLE_FRAMES = frozenset({0xC0, 0xC1, 0xC2})
_END, _START_OF_SCAN = 0xD9, 0xDA
# Besides: DHT, DAC, DQT, DNL, DRI, APPn, COM.
_SEGMENTS = _START_OF_FRAME | {_START_OF_SCAN, 0xC4, 0xCC, 0xDB, 0xDC, 0xDD,
                               *range(0xE0, 0xF0), 0xFE}
_MOST_SEGMENTS = 2 ** 16
_REMEDY = 'expected a whole jpeg file: check the driver and the transport'


def read_jpeg(data: memoryview) -> ImageFile:
    """
    Return size and scans of a jpeg file.

    Parameters
    ----------
    data : memoryview of bytes
        The file; what follows on its end is left alone.

    Raises
    ------
    ImageMessageError
        When the file is truncated, its size cannot be read, or it is none that a camera sends.

    """
    frame: tuple[int, int, int] | None = None
    scans, position = 0, 2
    for _ in range(_MOST_SEGMENTS):
        marker, segment, position = _next_segment(data, position)
        if marker == _END:
            if frame is None or not scans:
                raise ImageMessageError(f'holds no image; {_REMEDY}')
            width, height, components = frame
            return ImageFile(width, height, components, components == 1, scans, data)
        if marker in _START_OF_FRAME:
            if frame is not None:
                raise ImageMessageError(f'tells its size twice; {_REMEDY}')
            frame = _read_frame(marker, segment)
        elif marker == _START_OF_SCAN:
            scans += 1
    raise ImageMessageError(f'has more than {_MOST_SEGMENTS} segments; {_REMEDY}')


def _next_segment(data: memoryview, position: int) -> tuple[int, memoryview, int]:
    """Return the next marker, what its segment holds, and where that ends."""
    found = _MARKER.search(data, position)
    if found is None:
        raise ImageMessageError(f'is truncated; {_REMEDY}')
    start = found.end()
    marker = data[start - 1]
    if marker == _END:
        return marker, data[start:start], start
    if marker not in _SEGMENTS:
        raise ImageMessageError(
            f'has a marker FF{marker:02X}, at which its size cannot be told; {_REMEDY}')
    length = int.from_bytes(data[start:start + 2], 'big')
    if start + max(length, 2) > len(data):
        raise ImageMessageError(f'is truncated; {_REMEDY}')
    if length < 2:
        raise ImageMessageError(f'has a segment of {length} bytes; {_REMEDY}')
    return marker, data[start + 2:start + length], start + length


def _read_frame(marker: int, segment: memoryview) -> tuple[int, int, int]:
    """Return width, height and number of components."""
    if marker not in _READABLE_FRAMES:
        raise ImageMessageError(
            f'is of a kind of jpeg (SOF{marker - 0xC0}) that is not read; expected baseline or '
            'progressive jpeg with Huffman codes: set it in the driver, or send png')
    if len(segment) < 6 or len(segment) != 6 + 3 * segment[5]:
        raise ImageMessageError(f'does not tell its size; {_REMEDY}')
    height, width = (int.from_bytes(segment[at:at + 2], 'big') for at in (1, 3))
    if not width or not height:
        raise ImageMessageError(
            f'claims {width} x {height} pixels; expected its size in front of the pixels: send '
            'another kind of jpeg, or png')
    if segment[0] != 8 or segment[5] not in (1, 3, 4):
        raise ImageMessageError(
            f'holds {segment[5]} components of {segment[0]} bits; expected gray or color of '
            '8 bits: send png for more')
    return width, height, segment[5]
