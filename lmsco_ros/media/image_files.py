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

"""Images in files: one each, or many pages in a TIFF stack."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
import re

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.media.errors import MediaError
from lmsco_ros.media.false_color import without_false_color
from lmsco_ros.media.image_form import CommonForm
from lmsco_ros.media.tiff_stack import page_count, STACK_SUFFIXES, StackReader

IMAGE_SUFFIXES = frozenset({'.bmp', '.jpeg', '.jpg', '.pgm', '.png', '.tif', '.tiff'})

_SAME_SUFFIXES = {'.jpeg': '.jpg', '.tiff': '.tif'}
# Every depth and channel count as it is stored, turned as the file says.
_AS_STORED = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR


class ImageFiles:
    """
    Images in the order of time; every page of a TIFF stack is one.

    They are turned as their files say (EXIF), which is how viewers show them and how boxes
    are drawn.

    Parameters
    ----------
    paths : tuple of Path
        Image files in the order of time.

    """

    def __init__(self, paths: tuple[Path, ...]) -> None:
        """Keep the paths; nothing is decoded yet."""
        self._paths = paths
        self._form = CommonForm()
        self._stacks = StackReader()

    @classmethod
    def in_folder(cls, folder: Path) -> ImageFiles | None:
        """Return the images of `folder` in the order of their names, or None without any."""
        if not folder.is_dir():
            return None
        paths = [path for path in folder.iterdir()
                 if path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith('.')]
        return cls(tuple(sorted(paths, key=natural_order))) if paths else None

    @property
    def signature(self) -> str:
        """Names and sizes of the files."""
        return ';'.join(f'{path.name}:{path.stat().st_size}' for path in self._paths)

    def __len__(self) -> int:
        """Return the number of images."""
        return len(self._places)

    def __getitem__(self, index: int) -> npt.NDArray:
        """
        Decode image `index`.

        Raises
        ------
        MediaError
            When it cannot be read, or has another size or type than the first that was.

        """
        path, page = self._places[index]
        suffix = path.suffix.lower()
        stored = self._stacks.read(path, page) if suffix in STACK_SUFFIXES \
            else cv2.imread(str(path), _AS_STORED)
        name = path.name if page == 0 else f'page {page + 1} of {path.name}'
        if stored is None:
            raise MediaError(f'{name} is not a readable image; repair or remove it')
        image = without_false_color(stored)
        if image.dtype == np.float64:
            image = image.astype(np.float32)
        self._form.require(image, name, _SAME_SUFFIXES.get(suffix, suffix))
        return image

    def __iter__(self) -> Iterator[npt.NDArray]:
        """Yield the images."""
        return (self[index] for index in range(len(self)))

    @cached_property
    def _places(self) -> tuple[tuple[Path, int], ...]:
        """File and page of each image."""
        return tuple((path, page) for path in self._paths for page in range(
            page_count(path) if path.suffix.lower() in STACK_SUFFIXES else 1))


def natural_order(path: Path) -> tuple[tuple[str | int, ...], str]:
    """
    Return what to sort file names by: text as text and numbers as numbers, group by group.

    `frame9` comes before `frame10`, and `12_900` before `13_5`, whatever follows the first
    number.
    """
    groups = re.split(r'(\d+)', path.stem.casefold())
    return tuple(int(group) if number % 2 else group
                 for number, group in enumerate(groups)), path.name
