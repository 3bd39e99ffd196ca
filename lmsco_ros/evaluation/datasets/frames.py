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

"""Frames of a sequence, decoded only when they are asked for."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Optional, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.errors import SequenceError

IMAGE_SUFFIXES = frozenset({'.bmp', '.jpeg', '.jpg', '.pgm', '.png', '.tif', '.tiff'})
VIDEO_SUFFIXES = frozenset({'.avi', '.m4v', '.mkv', '.mov', '.mp4'})

# Video codecs leave a color cast of a few levels on footage that was gray.
_GRAY_TOLERANCE = 8


class FrameSource(Protocol):
    """Anything that hands out the images of a sequence by index."""

    @property
    def signature(self) -> str:
        """Text that changes when the frames change."""

    def __len__(self) -> int:
        """Return the number of frames."""

    def __getitem__(self, index: int) -> npt.NDArray:
        """Return image `index`: (H, W) of any depth, or (H, W, 3) uint8 in BGR order."""


def without_false_color(image: npt.NDArray) -> npt.NDArray:
    """
    Return a gray image for one that is stored in color but shows none.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        Image as decoded.

    Returns
    -------
    ndarray, shape (H, W) or (H, W, 3)
        One channel where the three agree to within a few levels, else the image itself.

    """
    if image.ndim == 2:
        return image
    blue, green, red = cv2.split(image)[:3]
    spread = max(cv2.absdiff(*pair).max() for pair in
                 ((blue, green), (green, red), (blue, red)))
    if spread <= _GRAY_TOLERANCE:
        return green
    return image if image.shape[2] == 3 else np.ascontiguousarray(image[..., :3])


class ImageFiles:
    """
    Frames in one file each.

    Parameters
    ----------
    paths : tuple of Path
        Image files in the order of time.

    """

    def __init__(self, paths: tuple[Path, ...]) -> None:
        """Keep the paths; nothing is decoded yet."""
        self._paths = paths

    @classmethod
    def in_folder(cls, folder: Path) -> Optional[ImageFiles]:
        """Return the images of `folder` in the order of their names, or None without any."""
        if not folder.is_dir():
            return None
        paths = [path for path in folder.iterdir()
                 if path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith('.')]
        return cls(tuple(sorted(paths, key=_frame_order))) if paths else None

    @property
    def signature(self) -> str:
        """Names and sizes of the files."""
        return ';'.join(f'{path.name}:{path.stat().st_size}' for path in self._paths)

    def __len__(self) -> int:
        """Return the number of files."""
        return len(self._paths)

    def __getitem__(self, index: int) -> npt.NDArray:
        """Decode image `index`."""
        image = cv2.imread(str(self._paths[index]), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise SequenceError(f'{self._paths[index].name} is not a readable image')
        return without_false_color(image)


class VideoFile:
    """
    Frames of a video, decoded forward; going back starts again at the first one.

    Parameters
    ----------
    path : Path
        Any file that OpenCV decodes.

    """

    def __init__(self, path: Path) -> None:
        """Read the number of frames."""
        self._path = path
        self._capture: Optional[cv2.VideoCapture] = None
        self._next = 0
        self._length = self._count_frames()

    @classmethod
    def in_folder(cls, folder: Path) -> Optional[VideoFile]:
        """Return the first video of `folder` that is not the visible-light one, or None."""
        paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in VIDEO_SUFFIXES
                       and not path.stem.lower().startswith(('visible', 'rgb')))
        return cls(paths[0]) if paths else None

    @property
    def signature(self) -> str:
        """Size of the file and digest of its two ends."""
        size = self._path.stat().st_size
        with self._path.open('rb') as stream:
            head = stream.read(1 << 16)
            stream.seek(max(size - (1 << 16), 0))
            digest = hashlib.sha256(head + stream.read()).hexdigest()
        return f'{self._path.name}:{size}:{digest}'

    def __len__(self) -> int:
        """Return the number of frames that the container states."""
        return self._length

    def __getitem__(self, index: int) -> npt.NDArray:
        """Decode frame `index`."""
        if not 0 <= index < self._length:
            raise IndexError(index)
        if self._capture is None or index < self._next:
            self._capture, self._next = self._open(), 0
        while self._next < index and self._capture.grab():
            self._next += 1
        decoded, image = self._capture.read()
        if not decoded:
            raise SequenceError(f'{self._path.name} ends before frame {index}, '
                                f'although it states {self._length} frames')
        self._next = index + 1
        return without_false_color(image)

    def __getstate__(self) -> dict:
        """Leave the decoder behind when the sequence goes to another process."""
        return {'_path': self._path, '_length': self._length, '_capture': None, '_next': 0}

    def _open(self) -> cv2.VideoCapture:
        capture = cv2.VideoCapture(str(self._path))
        if not capture.isOpened():
            raise SequenceError(f'{self._path.name} is not a readable video')
        return capture

    def _count_frames(self) -> int:
        capture = self._open()
        length = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        if length > 0:
            return length
        length = 0
        while capture.grab():
            length += 1
        return length


def _frame_order(path: Path) -> tuple[int, str]:
    digits = ''.join(character for character in path.stem if character.isdigit())
    return int(digits or 0), path.name
