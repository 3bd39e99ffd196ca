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

"""Files of images that cost as much as they can, by the rules of jpeg and png."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np

__all__ = ['jpeg_file', 'jpeg_segment', 'noise_jpeg', 'noise_png', 'png_chunk', 'png_file',
           'scans_jpeg']

_BLOCK_VALUES = 63
_RUN = 2 ** 14
# Code 10 for a run of 2 ** 14 blocks without more, and 14 bits for none beyond that.
_END_CODE = np.array([1] + [0] * 15, np.uint8)
# First column and row, and steps of both, of the seven passes of an interlaced png.
_PASSES = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2),
           (0, 1, 1, 2))
_WHOLE = ((0, 0, 1, 1),)
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_PAETH = 4


def jpeg_segment(marker: int, content: bytes) -> bytes:
    """Return a marker with its length and content."""
    return bytes((0xFF, marker)) + struct.pack('>H', len(content) + 2) + content


def jpeg_file(width: int, height: int, *, components: int = 1, frame: int = 0xC0,
              before: bytes = b'', scans: bytes | None = None) -> bytes:
    """
    Return a jpeg file of few bytes.

    Parameters
    ----------
    width, height : int
        As its head claims.
    components : int
        1 for gray, 3 for color.
    frame : int
        Marker in front of the size: 0xC0 for baseline, 0xC2 for progressive.
    before : bytes
        Stand in front of all segments.
    scans : bytes, optional
        Everything behind the tables; by default one scan of gray.

    """
    parts = range(1, components + 1)
    if scans is None:
        scans = _scan(components, (0, 63, 0)) + bytes(20)
    return b''.join((
        b'\xff\xd8', before, jpeg_segment(0xDB, b'\0' + b'\1' * 64),
        jpeg_segment(frame, struct.pack('>BHHB', 8, height, width, components)
                     + b''.join(bytes((part, 0x11, 0)) for part in parts)),
        _huffman(0x00, [1], [0]), _huffman(0x10, [1, 1], [0x01, 0xE0]), scans, b'\xff\xd9'))


def scans_jpeg(width: int, height: int, scans: int, full: int = 0) -> bytes:
    """
    Return a progressive color jpeg that goes over all of its blocks in every scan.

    Parameters
    ----------
    width, height : int
        Of the image.
    scans : int
        How many; at least 4.
    full : int
        How many of them, beside the first ones, carry random data: they take much longer and
        many bytes. The others carry next to nothing.

    """
    rng = np.random.default_rng(0)
    blocks = -(-width // 8) * -(-height // 8)
    runs = -(-blocks // _RUN)
    # Every value of every block: code 0 and a random sign; or an end for 2 ** 14 blocks.
    signs = rng.integers(0, 2, (blocks * _BLOCK_VALUES, 2), np.uint8)
    signs[:, 0] = 0
    ends = np.zeros((runs, 16 + _BLOCK_VALUES * _RUN), np.uint8)
    empty = _packed(ends[:, :16] | _END_CODE)
    ends[:, 16:] = rng.integers(0, 2, (runs, _BLOCK_VALUES * _RUN), np.uint8)
    ends[:, :16] = _END_CODE
    first, corrections = (_packed(signs), _packed(ends)) if full else (empty, empty)
    parts = [_scan(3, (0, 0, 0)), bytes(3 * blocks // 8 + 1)]
    for index in range(scans - 1):
        progress = 0x03 if index < 3 else 0x21
        data = first if index < 3 else corrections if index < 3 + full else empty
        parts += [_scan(1, (1, 63, progress), index % 3 + 1), data]
    return jpeg_file(width, height, components=3, frame=0xC2, scans=b''.join(parts))


def noise_jpeg(width: int, height: int, *, progressive: bool) -> bytes:
    """Return a color jpeg of noise without loss of resolution."""
    noise = np.random.default_rng(0).integers(0, 256, (height, width, 3), np.uint8)
    _, data = cv2.imencode('.jpg', noise, [
        cv2.IMWRITE_JPEG_QUALITY, 90, cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive),
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444])
    return data.tobytes()


def png_chunk(kind: bytes, content: bytes) -> bytes:
    """Return a chunk with its length and its checksum."""
    return struct.pack('>I', len(content)) + kind + content + struct.pack(
        '>I', zlib.crc32(kind + content))


def png_file(width: int, height: int, *, color: int = 0, depth: int = 8, interlace: int = 0,
             rows: bytes = b'', before: bytes = b'') -> bytes:
    """
    Return a png file.

    Parameters
    ----------
    width, height, color, depth, interlace : int
        As its head claims.
    rows : bytes
        Filtered rows of the image; by default next to nothing.
    before : bytes
        Chunks in front of the image.

    """
    head = struct.pack('>IIBBBBB', width, height, depth, color, 0, 0, interlace)
    return b''.join((b'\x89PNG\r\n\x1a\n', png_chunk(b'IHDR', head), before,
                     png_chunk(b'IDAT', zlib.compress(rows, 1)), png_chunk(b'IEND', b'')))


def noise_png(width: int, height: int, *, color: int, depth: int, interlace: bool) -> bytes:
    """Return a png of noise that is slow to unpack, with the costliest filter in each row."""
    rng = np.random.default_rng(0)
    rows = []
    for column, row, step, down in _PASSES if interlace else _WHOLE:
        size = (max(0, -(-(height - row) // down)), max(0, -(-(width - column) // step)))
        if 0 not in size:
            noise = rng.integers(0, 2, (size[0], 1 + size[1] * _CHANNELS[color] * depth // 8),
                                 np.uint8)
            noise[:, 0] = _PAETH
            rows.append(noise.tobytes())
    return png_file(width, height, color=color, depth=depth, interlace=int(interlace),
                    rows=b''.join(rows))


def _huffman(table: int, lengths: list[int], values: list[int]) -> bytes:
    return jpeg_segment(0xC4, bytes((table, *lengths, *[0] * (16 - len(lengths)), *values)))


def _scan(components: int, progress: tuple[int, int, int], first: int = 1) -> bytes:
    """Return the head of a scan of so many components."""
    parts = b''.join(bytes((part, 0)) for part in range(first, first + components))
    return jpeg_segment(0xDA, bytes((components,)) + parts + bytes(progress))


def _packed(bits: np.ndarray) -> bytes:
    """Return bits as bytes between two markers."""
    return np.packbits(bits).tobytes().replace(b'\xff', b'\xff\0')
