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

"""Sources of images: a folder, a video or a bag, told apart by looking."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.frames import ImageFiles, VideoFile
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.replay.bag_images import BagImages, is_bag
from lmsco_ros.replay.errors import SourceError
from lmsco_ros.replay.frame import Frame

_DEFAULT_FPS = 30.0


class Source(Protocol):
    """Frames in the order of time, decoded as they are asked for."""

    @property
    def fps(self) -> float:
        """Frames per second, at least roughly."""

    def __len__(self) -> int:
        """Return the number of frames that the source states."""

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; a damaged end is left out."""


def open_source(path: Path, *, topic: str = '', fps: float = 0.0) -> Source:
    """
    Return the images of `path`.

    Parameters
    ----------
    path : Path
        Folder of images (png, jpg, tiff, bmp; 8 or 16 bit), video file, or rosbag2.
    topic : str
        Image topic of a bag; may be left out when there is only one.
    fps : float
        Frames per second of what has no stamps; by default the video's own, or 30.

    Raises
    ------
    SourceError
        When there is nothing to read, or it is not clear what.

    """
    if not path.exists():
        raise SourceError(f'{path} does not exist; '
                          'give a folder of images, a video file or a bag')
    if is_bag(path):
        return BagImages(path, topic)
    if topic:
        raise SourceError(f'{path} is not a bag, so it has no topic {topic}; '
                          'leave out the topic')
    if path.is_dir():
        return IndexedImages(_images_in(path), fps or _DEFAULT_FPS)
    try:
        video = VideoFile(path)
    except SequenceError as error:
        raise SourceError(f'{path} is not a readable video; give a video that OpenCV decodes, '
                          'a folder of images or a bag') from error
    return IndexedImages(video, fps or _stated_fps(path))


@dataclass(frozen=True)
class IndexedImages:
    """
    Images by number at a constant rate.

    Attributes
    ----------
    images : ImageFiles or VideoFile
        Decoder.
    fps : float
        Frames per second.

    """

    images: ImageFiles | VideoFile
    fps: float

    def __len__(self) -> int:
        """Return the number of images that the folder or container states."""
        return len(self.images)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, all gray or all in color; stamps start at 0."""
        first: npt.NDArray | None = None
        for index in range(len(self.images)):
            try:
                image = self.images[index]
            except SequenceError as error:
                if first is None or isinstance(self.images, ImageFiles):
                    raise SourceError(f'{error}; repair or remove it') from error
                # Containers often state some frames more than there are.
                return
            first = image if first is None else first
            yield Frame(index, round(index * 1e9 / self.fps), _like(first, image))


def _images_in(folder: Path) -> ImageFiles:
    images = ImageFiles.in_folder(folder)
    if images is not None:
        return images
    inner = [child.name for child in sorted(folder.iterdir())
             if child.is_dir() and ImageFiles.in_folder(child) is not None]
    hint = (f'its folder {inner[0]} has some: give {folder / inner[0]}' if inner
            else 'give a folder with png, jpg, tiff or bmp files')
    raise SourceError(f'{folder} has no images; {hint}')


def _stated_fps(path: Path) -> float:
    capture = cv2.VideoCapture(str(path))
    fps = capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    return float(fps) if 0.1 <= fps <= 1000 else _DEFAULT_FPS


def _like(first: npt.NDArray, image: npt.NDArray) -> npt.NDArray:
    """Return `image` with as many channels as `first`: sequences do not change halfway."""
    if first.ndim == image.ndim:
        return image
    if first.ndim == 2:
        return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.repeat(image[..., None], 3, axis=2)
