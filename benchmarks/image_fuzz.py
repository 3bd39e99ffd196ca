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
Read thousands of generated images, most of them broken, and count what becomes of them.

Raw messages with sizes, steps, encodings and data that need not fit each other; jpeg and png
files and those of `compressedDepth` that are cut, changed, lengthened, or claim another size.
Each has to be read or refused; anything else ends the run with its number. In the folder of the
repository:
python -m benchmarks.image_fuzz [--count N] [--seed N] [--page docs/field.md]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
import struct
from typing import Any

import cv2
import numpy as np
from sensor_msgs.msg import CompressedImage, Image

from benchmarks.call_cost import call_cost, CallCost
from benchmarks.challenge_table import insert
from benchmarks.costly_images import jpeg_file, jpeg_segment, noise_png, png_chunk
from benchmarks.measurement import markdown_table, positive
from msg_adapters.compressed import DecodingLimits, image_from_compressed
from msg_adapters.encodings import ENCODINGS
from msg_adapters.errors import ImageMessageError
from msg_adapters.image import image_from_message

__all__ = ['Generator', 'KINDS', 'Tally', 'fuzz', 'UnexpectedError']

KINDS = ('raw', 'jpeg', 'png', 'compressedDepth')
_DTYPES = (np.uint8, np.uint16, np.int16, np.int32, np.float32, np.float64)
_SIDES = (0, 1, 7, 8, 640, 4096, 4097, 16000, 40000, 65535)
_FORMATS = ('', 'jpeg', 'mono8; png compressed ', '16UC1; compressedDepth png',
            '32FC1; compressedDepth png', '32FC1; compressedDepth rvl')


class UnexpectedError(Exception):
    """An image was neither read nor refused, or read as something that is no image."""


@dataclass
class Tally:
    """
    What became of the images of one kind.

    Attributes
    ----------
    read, refused : int
        How many.
    seconds, mebibytes : float
        The most that one took.

    """

    read: int = 0
    refused: int = 0
    seconds: float = 0
    mebibytes: float = 0

    def note(self, read: bool, cost: CallCost) -> None:
        """Count one image."""
        self.read += read
        self.refused += not read
        self.seconds = max(self.seconds, cost.seconds)
        self.mebibytes = max(self.mebibytes, cost.mebibytes)


class Generator:
    """
    Makes messages at random.

    Parameters
    ----------
    seed : int
        The same makes the same messages.

    """

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def message(self, kind: str) -> Image | CompressedImage:
        """Return the next message of a kind."""
        if kind == 'raw':
            return self._raw()
        if kind == 'compressedDepth':
            scale = self._pick((100., 1., -1., 0., np.nan))
            head = struct.pack('<iff', 0, scale, self._rng.normal())
            data = head + self._png(color=0, depth=16)
        else:
            data = self._png() if kind == 'png' else self._jpeg()
        for _ in range(self._rng.integers(0, 4)):
            data = self._pick((self._cut, self._flip, self._insert, self._claim, bytes))(data)
        return CompressedImage(data=data, format=self._pick(
            _FORMATS[3:] if kind == 'compressedDepth' else _FORMATS))

    def _raw(self) -> Image:
        encoding = self._pick((*ENCODINGS, 'jpeg', '32FC3', ''))
        height, width = (int(side) for side in self._rng.integers(0, 40, 2))
        layout = ENCODINGS.get(encoding, ENCODINGS['mono8'])
        step = max(0, width * layout.pixel_bytes + int(self._rng.integers(-2, 6)))
        size = max(0, step * layout.rows(height) + self._pick((0, 0, 0, 1, -1, -step, -10 ** 6)))
        return Image(height=height, width=width, step=step, encoding=encoding,
                     is_bigendian=self._pick((0, 1)), data=self._rng.bytes(size))

    def _jpeg(self) -> bytes:
        if self._pick((True, False, False, False)):
            return jpeg_file(*(self._pick(_SIDES) for _ in 'wh'), frame=self._pick(
                range(0xC0, 0xD0)), components=self._pick((1, 3)))
        pixels = self._rng.integers(0, 256, (*self._rng.integers(1, 64, 2), self._pick((1, 3))),
                                    np.uint8)
        _, data = cv2.imencode('.jpg', pixels, [
            cv2.IMWRITE_JPEG_PROGRESSIVE, self._pick((0, 1)),
            cv2.IMWRITE_JPEG_RST_INTERVAL, self._pick((0, 1, 5))])
        return data.tobytes()

    def _png(self, **kind: int) -> bytes:
        kind = kind or self._pick(({'color': 0, 'depth': 8}, {'color': 0, 'depth': 16},
                                   {'color': 2, 'depth': 8}, {'color': 6, 'depth': 16},
                                   {'color': 4, 'depth': 8}, {'color': 3, 'depth': 8}))
        width, height = (int(side) for side in self._rng.integers(1, 64, 2))
        return noise_png(width, height, interlace=self._pick((True, False)), **kind)

    def _cut(self, data: bytes) -> bytes:
        return data[:self._place(data)]

    def _flip(self, data: bytes) -> bytes:
        changed = bytearray(data)
        for _ in range(self._rng.integers(1, 8)):
            if changed:
                changed[self._place(data) % len(changed)] = self._rng.integers(0, 256)
        return bytes(changed)

    def _insert(self, data: bytes) -> bytes:
        place = self._pick((2, 8, 33, self._place(data)))
        marker = bytes((0xFF, self._rng.integers(0, 256)))
        return data[:place] + self._pick((
            marker, marker * 100, b'\xff' * 50, self._rng.bytes(20),
            jpeg_segment(marker[1], self._rng.bytes(9)), png_chunk(b'IDAT', self._rng.bytes(9)),
            png_chunk(b'zTXt', self._rng.bytes(9)), png_chunk(b'fdAT', data[:99]))) + data[place:]

    def _claim(self, data: bytes) -> bytes:
        sides = [self._pick(_SIDES) for _ in 'wh']
        png = data.find(b'IHDR')
        if png >= 0:
            head = struct.pack('>II', *sides) + data[png + 12:png + 17]
            return data[:png - 4] + png_chunk(b'IHDR', head) + data[png + 21:]
        jpeg = max(data.find(b'\xff\xc0'), data.find(b'\xff\xc2'))
        return data[:jpeg + 5] + struct.pack('>HH', *sides) + data[jpeg + 9:]

    def _place(self, data: bytes) -> int:
        return int(self._rng.integers(0, len(data) + 1))

    def _pick(self, values: Sequence[Any]) -> Any:
        return values[self._rng.integers(0, len(values))]


def fuzz(count: int, seed: int = 0) -> dict[str, Tally]:
    """
    Read generated images of each kind in turns.

    Parameters
    ----------
    count : int
        How many in all.
    seed : int
        Of the generator.

    Raises
    ------
    UnexpectedError
        When one is neither read as an image nor refused as a message.

    """
    generator, tallies = Generator(seed), {kind: Tally() for kind in KINDS}
    for number in range(count):
        kind = KINDS[number % len(KINDS)]
        message = generator.message(kind)
        reading = _Reading(image_from_message if kind == 'raw' else image_from_compressed, message)
        try:
            cost = call_cost(reading)
        except Exception as error:
            raise UnexpectedError(f'image {number} ({kind}) of seed {seed}: {error!r}') from error
        tallies[kind].note(reading.was_read, cost)
    return tallies


class _Reading:
    """A call that reads a message, or finds that it is refused."""

    def __init__(self, read: Callable, message: Image | CompressedImage) -> None:
        self._read = read
        self._message = message
        self.was_read = False

    def __call__(self) -> None:
        try:
            image = self._read(self._message)
        except ImageMessageError:
            return
        gray = image.ndim == 2 and image.dtype in _DTYPES
        color = image.ndim == 3 and image.shape[2] == 3 and image.dtype == np.uint8
        pixels = image.shape[0] * image.shape[1]
        if not (gray or color) or not 1 <= pixels <= DecodingLimits().pixels:
            raise UnexpectedError(f'read as {image.shape} {image.dtype}')
        self.was_read = True


def main(arguments: list[str] | None = None) -> None:
    """Print the table, or write it into a page."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--count', type=positive, default=10000)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--page', type=Path, help='Markdown page that takes the table')
    options = parser.parse_args(arguments)
    tallies = fuzz(options.count, options.seed)
    table = markdown_table(
        ('images', 'read', 'refused', 'most processor time (s)', 'most memory (MiB)'),
        [(kind, tally.read, tally.refused, tally.seconds, tally.mebibytes)
         for kind, tally in tallies.items()])
    print(table)
    if options.page is not None:
        page = insert(options.page.read_text(encoding='utf-8'), 'generated images', table)
        options.page.write_text(page, encoding='utf-8')


if __name__ == '__main__':
    main()
