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

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy.typing as npt

from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.media.errors import MediaError
from lmsco_ros.media.image_files import ImageFiles
from lmsco_ros.media.video import VideoFile

VIDEO_SUFFIXES = frozenset({'.avi', '.m4v', '.mkv', '.mov', '.mp4'})


class FrameSource(Protocol):
    """Anything that hands out the images of a sequence by index."""

    @property
    def signature(self) -> str:
        """Text that changes when the frames change."""

    def __len__(self) -> int:
        """Return the number of frames."""

    def __getitem__(self, index: int) -> npt.NDArray:
        """Return image `index`: (H, W) of any depth, or (H, W, 3) uint8 in BGR order."""


@dataclass(frozen=True, eq=False)
class StoredFrames:
    """
    Frames in files; one that cannot be read makes its sequence a broken one.

    Attributes
    ----------
    images : ImageFiles or VideoFile
        Decoder.

    """

    images: ImageFiles | VideoFile

    @property
    def signature(self) -> str:
        """Text that changes when the frames change."""
        return self.images.signature

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.images)

    def __getitem__(self, index: int) -> npt.NDArray:
        """Return image `index`, or raise `SequenceError`."""
        try:
            return self.images[index]
        except MediaError as error:
            raise SequenceError(str(error)) from error


def image_folder(folder: Path) -> StoredFrames | None:
    """Return the images of `folder` in the order of their names, or None without any."""
    images = ImageFiles.in_folder(folder)
    return None if images is None else StoredFrames(images)


def thermal_video(folder: Path) -> StoredFrames | None:
    """
    Return the first video of `folder` that is not the visible-light one, or None.

    Raises
    ------
    SequenceError
        When it cannot be read.

    """
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in VIDEO_SUFFIXES
                   and not path.stem.lower().startswith(('visible', 'rgb')))
    try:
        return StoredFrames(VideoFile(paths[0])) if paths else None
    except MediaError as error:
        raise SequenceError(str(error)) from error
