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

"""Where training examples come from: thermal clips with boxes, and stills that are set moving."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator
import csv
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.pixels import to_gray
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.split import load_split

__all__ = ['Clip', 'SPLIT', 'Still', 'data_folder', 'load_clips', 'load_stills']

SPLIT = Path(__file__).parents[1] / 'benchmarks' / 'thermal_dev.yaml'
"""The project's split of `thermal_dev`."""

_SMALLEST_SIDE = 6.0
_NATURAL_SIDES = (16.0, 90.0)


@dataclass(frozen=True)
class Clip:
    """
    Decoded frames of one target.

    Attributes
    ----------
    name : str
        Group and name of the sequence.
    frames : ndarray, shape (n, H, W), uint8
        Gray images.
    boxes : ndarray, shape (n, 4)
        x, y, width, height; NaN where the target is absent.

    """

    name: str
    frames: npt.NDArray[np.uint8]
    boxes: npt.NDArray[np.float64]

    @property
    def present(self) -> npt.NDArray[np.intp]:
        """Indices of the frames that show a target large enough to learn from."""
        usable = ~is_absent(self.boxes) & (self.boxes[:, 2:].min(axis=1) >= _SMALLEST_SIDE)
        return np.flatnonzero(usable)

    def view(self, index: int) -> FrameView:
        """Return a frame in the working range of a fresh automatic gain."""
        return view_of(self.frames[index])

    def box(self, index: int) -> BoundingBox:
        """Return the true box of a frame."""
        return BoundingBox(*self.boxes[index])


@dataclass(frozen=True)
class Still:
    """
    One image and the boxes that stand in it.

    Attributes
    ----------
    image : ndarray, shape (H, W), uint8
        Gray image.
    boxes : tuple of BoundingBox
        Objects; empty where any place will do.

    """

    image: npt.NDArray[np.uint8]
    boxes: tuple[BoundingBox, ...]

    def view(self) -> FrameView:
        """Return the image in the working range of a fresh automatic gain."""
        return view_of(self.image)

    def pick(self, rng: np.random.Generator) -> BoundingBox:
        """Return one of the boxes, or a random one in an image without."""
        if self.boxes:
            return self.boxes[rng.integers(len(self.boxes))]
        height, width = self.image.shape
        side = float(np.exp(rng.uniform(*np.log(_NATURAL_SIDES))))
        aspect = float(np.exp(rng.normal(0, 0.25)))
        center = (rng.uniform(0.2, 0.8) * width, rng.uniform(0.2, 0.8) * height)
        return BoundingBox.from_center(center, (side * aspect, side / aspect))


def view_of(image: npt.NDArray) -> FrameView:
    """Return an image seen through the tracker's own automatic gain."""
    return FrameView(image, AutomaticGain(IntensityConfig()).observe(image))


def data_folder(*parts: str) -> Callable[[str], Path]:
    """Return what makes the folder DATA of a command line, or tells which part it lacks."""
    def folder(text: str) -> Path:
        for part in parts:
            if not (Path(text) / part).is_dir():
                raise ArgumentTypeError(f'{text} holds no folder {part}; give the folder that '
                                        f'holds {" and ".join(parts)}')
        return Path(text)
    return folder


def load_clips(dataset: Path, part: str, stride: int = 1) -> list[Clip]:
    """
    Decode the sequences of one part of the project's split.

    Parameters
    ----------
    dataset : Path
        Folder `thermal_dev`.
    part : {'train', 'test'}
        The test part is for looking at, never for training.
    stride : int
        Every how many frames are kept.

    """
    sequences = load_split(SPLIT).select(part, scan_dataset(dataset).sequences)
    clips = []
    for sequence in sequences:
        frames = np.stack([to_gray(sequence.frames[i]) for i in range(len(sequence))
                           if i % stride == 0])
        clips.append(Clip(sequence.full_name, frames, sequence.ground_truth[::stride]))
    return [clip for clip in clips if len(clip.present) > 1]


def load_stills(folder: Path) -> list[Still]:
    """
    Read `hit_uav` with its boxes and `natural` without.

    Parameters
    ----------
    folder : Path
        Folder `training_stills`.

    """
    boxes: dict[str, list[BoundingBox]] = {}
    with (folder / 'hit_uav_boxes.csv').open(encoding='utf-8') as stream:
        for row in csv.DictReader(stream):
            sides = (float(row['x']), float(row['y']), float(row['width']), float(row['height']))
            if min(sides[2:]) >= _SMALLEST_SIDE:
                boxes.setdefault(row['image'], []).append(BoundingBox(*sides))
    thermal = [Still(_read(folder / 'hit_uav' / name), tuple(found))
               for name, found in sorted(boxes.items())]
    return thermal + [Still(_read(path), ()) for path in _images(folder / 'natural')]


def _images(folder: Path) -> Iterator[Path]:
    """Return the files of a folder in the order of their names."""
    return iter(sorted(path for path in folder.iterdir() if path.is_file()))


def _read(path: Path) -> npt.NDArray[np.uint8]:
    """Return a gray image."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise ValueError(f'{path} is not a readable image; expected a PNG or JPEG file')
    return image
