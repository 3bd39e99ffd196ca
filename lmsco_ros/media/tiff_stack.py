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

"""TIFF stacks: many images, the pages, in one file."""

from __future__ import annotations

from os import SEEK_CUR
from pathlib import Path
import struct
from typing import BinaryIO
import warnings

import cv2
import numpy.typing as npt

from lmsco_ros.media.errors import MediaWarning

STACK_SUFFIXES = frozenset({'.tif', '.tiff'})

# OpenCV goes through a stack from its beginning for every call: a few pages at a time.
_PAGES_AT_ONCE = 16
_AS_STORED = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR


class StackReader:
    """Pages of stacks, decoded with their neighbors, of which only a few are held."""

    def __init__(self) -> None:
        """Hold nothing yet."""
        self._held: tuple[Path, int] | None = None
        self._pages: tuple[npt.NDArray, ...] = ()

    def read(self, path: Path, page: int) -> npt.NDArray | None:
        """Return page `page`, from 0, turned as the file says; None when it cannot be read."""
        block, place = divmod(page, _PAGES_AT_ONCE)
        if self._held != (path, block):
            self._held, self._pages = (path, block), _decode(path, block * _PAGES_AT_ONCE)
        return self._pages[place] if place < len(self._pages) else None

    def __getstate__(self) -> dict:
        """Leave decoded pages behind."""
        return {'_held': None, '_pages': ()}


def page_count(path: Path) -> int:
    """
    Return the number of pages that are there, 1 for a file that cannot be read.

    A file that ends before its last page is told by a `MediaWarning`.
    """
    try:
        pages = max(cv2.imcount(str(path), _AS_STORED), 1)
    except cv2.error:
        pages = 1
    with path.open('rb') as stream:
        if _is_cut(stream):
            warnings.warn(f'{path.name} is cut off after {pages} pages', MediaWarning,
                          stacklevel=2)
    return pages


def _decode(path: Path, first: int) -> tuple[npt.NDArray, ...]:
    try:
        return tuple(cv2.imreadmulti(
            str(path), start=first, count=_PAGES_AT_ONCE, flags=_AS_STORED)[1])
    except cv2.error:
        return ()


def _is_cut(stream: BinaryIO) -> bool:
    """Tell whether a page says that the next one is where the file has ended already."""
    head = stream.read(16).ljust(16, b'\0')
    order = {b'II': '<', b'MM': '>'}.get(head[:2])
    if order is None:
        return False
    is_big = struct.unpack_from(f'{order}H', head, 2)[0] == 43
    number, entry, link = (f'{order}Q', 20, f'{order}Q') if is_big \
        else (f'{order}H', 12, f'{order}I')
    place, seen = struct.unpack_from(link, head, 8 if is_big else 4)[0], set()
    try:
        # Some writers link the last page to the first.
        while place and place not in seen:
            seen.add(place)
            stream.seek(place)
            entries, = struct.unpack(number, stream.read(struct.calcsize(number)))
            stream.seek(entry * entries, SEEK_CUR)
            place, = struct.unpack(link, stream.read(struct.calcsize(link)))
    except (struct.error, OverflowError):
        return True
    return False
