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

"""Size and pixels of a png file (ISO/IEC 15948), without what else it may hold."""

from __future__ import annotations

from collections.abc import Iterator
import struct
import zlib

from msg_adapters.errors import ImageMessageError
from msg_adapters.image_file import ImageFile

__all__ = ['check_unfolding', 'PNG_START', 'read_png']

PNG_START = b'\x89PNG\r\n\x1a\n'

_MOST_CHUNKS = 2 ** 16
_HEAD = struct.Struct('>IIBBBBB')
_GRAY, _COLOR, _PALETTE, _GRAY_ALPHA, _COLOR_ALPHA = 0, 2, 3, 4, 6
_DEPTHS = {_GRAY: (1, 2, 4, 8, 16), _COLOR: (8, 16), _PALETTE: (1, 2, 4, 8),
           _GRAY_ALPHA: (8, 16), _COLOR_ALPHA: (8, 16)}
# Channels of what OpenCV makes of them.
_CHANNELS = {_GRAY: 1, _COLOR: 3, _PALETTE: 3, _GRAY_ALPHA: 4, _COLOR_ALPHA: 4}
# Some decoders take time and memory for every row, however short it is.
_LONGEST_SIDE = 2 ** 16 - 1
# Deflate packs no tighter than this, and less than so many bytes unfold within a second.
_TIGHTEST, _HARMLESS_BYTES = 1032, 2 ** 29
_PIECE_BYTES = 2 ** 18
_REMEDY = 'expected a whole png file: check the driver and the transport'


def read_png(data: memoryview) -> ImageFile:
    """
    Return size and pixels of a png file.

    Chunks that are no part of the first image are left out: texts and color profiles may unfold
    to gigabytes, and further images of an animation are not wanted.

    Parameters
    ----------
    data : memoryview of bytes
        The file; what follows on its end is left alone.

    Raises
    ------
    ImageMessageError
        When the file is truncated, its head breaks the rules, or a side is longer than 65,535
        pixels.

    """
    kept = [data[:len(PNG_START)]]
    position, head = len(PNG_START), None
    for _ in range(_MOST_CHUNKS):
        kind, chunk, position = _next_chunk(data, position)
        if (kind == b'IHDR') != (head is None):
            raise ImageMessageError(f'does not begin with one head; {_REMEDY}')
        if head is None:
            head = _read_head(chunk[8:-4])
        elif kind not in (b'PLTE', b'IDAT', b'IEND'):
            if not kind[0] & 0x20:
                raise ImageMessageError(f'has a chunk {kind!r} that is not known; {_REMEDY}')
            continue
        kept.append(chunk)
        if kind == b'IEND':
            width, height, pixel_bytes, gray = head
            return ImageFile(width, height, pixel_bytes, gray, 1, b''.join(kept))
    raise ImageMessageError(f'has more than {_MOST_CHUNKS} chunks; {_REMEDY}')


def check_unfolding(file: ImageFile) -> None:
    """
    Refuse a png whose packed pixels would unfold to far more than its pixels.

    The decoder unfolds them to the end, whatever the size of the image. Files too short to take
    long are not looked at.

    Parameters
    ----------
    file : ImageFile
        As `read_png` returns it, of a size that may be decoded.

    Raises
    ------
    ImageMessageError
        When there is more than the rows of the image.

    """
    if len(file.data) * _TIGHTEST <= _HARMLESS_BYTES:
        return
    # Each row, of each pass of an interlaced one, begins with a byte and may end in a broken one.
    most = file.width * file.height * file.pixel_bytes + 4 * file.height + 28
    if any(size > most for size in _unfolded_sizes(memoryview(file.data))):
        raise ImageMessageError(
            f'holds more than its {file.width} x {file.height} pixels; {_REMEDY}')


def _unfolded_sizes(data: memoryview) -> Iterator[int]:
    """Unfold the pixels of a png bit by bit, and tell how many bytes there are so far."""
    unfold, size, position, kind = zlib.decompressobj(), 0, len(PNG_START), b''
    while kind != b'IEND' and not unfold.eof:
        kind, chunk, position = _next_chunk(data, position)
        packed = chunk[8:-4] if kind == b'IDAT' else b''
        while packed:
            try:
                size += len(unfold.decompress(packed, _PIECE_BYTES))
            except zlib.error as error:
                raise ImageMessageError(f'is damaged; {_REMEDY}') from error
            yield size
            packed = unfold.unconsumed_tail


def _next_chunk(data: memoryview, position: int) -> tuple[bytes, memoryview, int]:
    """Return the kind of the next chunk, all its bytes, and where it ends."""
    head = data[position:position + 8]
    end = position + 12 + int.from_bytes(head[:4], 'big')
    if len(head) < 8 or end > len(data):
        raise ImageMessageError(f'is truncated; {_REMEDY}')
    return bytes(head[4:]), data[position:end], end


def _read_head(head: memoryview) -> tuple[int, int, int, bool]:
    """Return width, height, bytes of a pixel, and whether it is gray."""
    if len(head) != _HEAD.size:
        raise ImageMessageError(f'does not tell its size; {_REMEDY}')
    width, height, depth, color, compression, filters, interlace = _HEAD.unpack(head)
    if depth not in _DEPTHS.get(color, ()) or compression or filters or interlace > 1:
        raise ImageMessageError(
            f'has a head that breaks the rules of png (color type {color}, {depth} bits, '
            f'compression {compression}, filter {filters}, interlace {interlace}); {_REMEDY}')
    if not 1 <= width <= _LONGEST_SIDE or not 1 <= height <= _LONGEST_SIDE:
        raise ImageMessageError(
            f'claims {width} x {height} pixels; expected 1 to {_LONGEST_SIDE} in each direction: '
            'send smaller frames')
    return (width, height, _CHANNELS[color] * (2 if depth == 16 else 1),
            color in (_GRAY, _GRAY_ALPHA))
