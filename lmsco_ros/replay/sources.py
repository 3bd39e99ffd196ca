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

"""Sources of images: a folder, an image, a film or a bag, told apart by looking."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
import warnings

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.media.errors import MediaError, MediaWarning
from lmsco_ros.media.image_files import IMAGE_SUFFIXES, ImageFiles
from lmsco_ros.media.video import VideoFile
from lmsco_ros.replay.bag_images import BagImages
from lmsco_ros.replay.bags.files import is_bag
from lmsco_ros.replay.errors import SourceError
from lmsco_ros.replay.frame import RecordedFrame

_DEFAULT_FPS = 30.0


class Source(Protocol):
    """Frames in the order of time, decoded as they are asked for."""

    @property
    def fps(self) -> float:
        """Frames per second, at least roughly."""

    def __len__(self) -> int:
        """Return the number of frames that the source states."""

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Yield the frames; a damaged end is left out."""


def open_source(path: Path, *, topic: str = '', fps: float = 0.0) -> Source:
    """
    Return the images of `path`.

    Parameters
    ----------
    path : Path
        Folder of images (png, jpg, tiff, bmp, pgm; 8 or 16 bit), one image or TIFF stack,
        film, or rosbag2.
    topic : str
        Image topic of a bag; may be left out when there is only one.
    fps : float
        Frames per second of images without times, by default 30; of a film it replaces the
        times of the container.

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
    if path.suffix.lower() in IMAGE_SUFFIXES:
        return IndexedImages(_images_of(path), fps or _DEFAULT_FPS)
    try:
        film = VideoFile(path)
    except MediaError as error:
        raise SourceError(f'{error}; give a film that FFmpeg decodes, a folder of images '
                          'or a bag') from error
    return IndexedImages(film, fps) if fps else TimedImages(film)


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

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Yield the frames, all gray or all in color; stamps start at 0."""
        return _frames((round(index * 1e9 / self.fps), image)
                       for index, image in enumerate(self.images))


@dataclass(frozen=True)
class TimedImages:
    """
    Images of a film at the times of its container.

    Attributes
    ----------
    film : VideoFile
        Decoder.

    """

    film: VideoFile

    @property
    def fps(self) -> float:
        """Frames per second, on average."""
        return self.film.fps

    def __len__(self) -> int:
        """Return the number of frames that the container states."""
        return len(self.film)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Yield the frames, all gray or all in color; stamps start at 0."""
        return _frames(self.film.timed())


def _images_in(folder: Path) -> ImageFiles:
    images = ImageFiles.in_folder(folder)
    if images is not None:
        return images
    inner = [child.name for child in sorted(folder.iterdir())
             if child.is_dir() and ImageFiles.in_folder(child) is not None]
    hint = (f'its folder {inner[0]} has some: give {folder / inner[0]}' if inner
            else 'give a folder with png, jpg, tiff, bmp or pgm files')
    raise SourceError(f'{folder} has no images; {hint}')


def _images_of(path: Path) -> ImageFiles:
    """Return the pages of an image file; of a single one say that it may not be meant."""
    images = ImageFiles((path,))
    if len(images) == 1:
        warnings.warn(f'{path} is one image; for a recording give the folder of its images',
                      MediaWarning, stacklevel=3)
    return images


def _frames(images: Iterable[tuple[int, npt.NDArray]]) -> Iterator[RecordedFrame]:
    """Yield stamps and images as frames with as many channels as the first has."""
    dimensions = 0
    try:
        for index, (stamp, image) in enumerate(images):
            dimensions = dimensions or image.ndim
            yield RecordedFrame(index, stamp, _with_dimensions(image, dimensions))
    except MediaError as error:
        raise SourceError(str(error)) from error


def _with_dimensions(image: npt.NDArray, dimensions: int) -> npt.NDArray:
    """Return `image` in gray (2) or in color (3): sequences do not change halfway."""
    if image.ndim == dimensions:
        return image
    if dimensions == 2:
        return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.repeat(image[..., None], 3, axis=2)
