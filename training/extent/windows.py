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
Real pictures to train on, cut small: windows of clips around their target, of stills, of texture.

    python -m training.extent.windows --data DATA --output WINDOWS.npz

DATA holds `thermal_dev` and `training_stills`. One file of some tens of megabytes goes wherever
the training runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import torch

from lmsco_ros.core.types import BoundingBox
from training.sources import Clip, data_folder, load_clips, load_stills, Still

__all__ = ['SIDE', 'Windows', 'read_windows', 'write_windows']

SIDE = 128
"""Side of a window in pixels."""

_LARGEST_TARGET = 32.0
_CLIP_STRIDE = 5
_VALIDATION_EVERY = 5
_QUALITY = 94


@dataclass(frozen=True)
class Windows:
    """
    Square pictures, on one device.

    Attributes
    ----------
    images : tensor, shape (n, SIDE, SIDE), uint8
        Gray levels.
    boxes : tensor, shape (n, 4)
        Target (x0, y0, x1, y1) in pixels of the window; NaN where there is none.
    bounds : tensor, shape (n, 4)
        The part (x0, y0, x1, y1) of the window that the image covers.
    scales : tensor, shape (n,)
        Pixels of the camera in one of the window.
    groups : tensor, shape (n,), int64
        Number of the clip or the still that a window was cut from.

    """

    images: torch.Tensor
    boxes: torch.Tensor
    bounds: torch.Tensor
    scales: torch.Tensor
    groups: torch.Tensor

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.images)

    def __getitem__(self, chosen: torch.Tensor) -> Windows:
        """Return some of them, by index or by mask."""
        return Windows(*(value[chosen] for value in vars(self).values()))

    def to(self, device: torch.device) -> Windows:
        """Return them on a device."""
        return Windows(*(value.to(device) for value in vars(self).values()))


@dataclass(frozen=True)
class _Window:
    """One window, see `Windows`."""

    image: npt.NDArray[np.uint8]
    box: npt.NDArray[np.float64]
    bounds: npt.NDArray[np.float64]
    scale: float
    group: int


def write_windows(path: Path, parts: dict[str, Sequence[_Window]]) -> None:
    """Write named collections of windows to one file; their pictures as JPEG."""
    arrays: dict[str, npt.NDArray] = {}
    for name, windows in parts.items():
        files = [cv2.imencode('.jpg', window.image, (cv2.IMWRITE_JPEG_QUALITY, _QUALITY))[1]
                 for window in windows]
        arrays[f'{name}.files'] = np.concatenate(files)
        arrays[f'{name}.lengths'] = np.array([len(file) for file in files])
        arrays[f'{name}.values'] = np.array(
            [[*window.box, *window.bounds, window.scale, window.group] for window in windows])
    np.savez(path, **arrays)


def read_windows(path: Path, name: str) -> Windows:
    """Return a collection of `write_windows`."""
    with np.load(path) as archive:
        files, lengths, values = (archive[f'{name}.{part}']
                                  for part in ('files', 'lengths', 'values'))
    images = np.stack([cv2.imdecode(file, cv2.IMREAD_GRAYSCALE)
                       for file in np.split(files, np.cumsum(lengths)[:-1])])
    numbers = torch.from_numpy(values)
    return Windows(torch.from_numpy(images), numbers[:, :4].float(), numbers[:, 4:8].float(),
                   numbers[:, 8].float(), numbers[:, 9].long())


def cut(image: npt.NDArray[np.uint8], box: npt.NDArray[np.float64], around: Sequence[float],
        scale: float, group: int) -> _Window:
    """
    Return the window around a point of an image.

    Parameters
    ----------
    image : ndarray, shape (H, W), uint8
        Gray image; its border is repeated outside of it.
    box : ndarray, shape (4,)
        Target (x, y, width, height) in pixels of the image; NaN where there is none.
    around : sequence of float
        Point (x, y) for the middle of the window.
    scale : float
        Pixels of the image in one of the window.
    group : int
        Number of the clip or still.

    """
    corner = np.array(around) - scale * SIDE / 2
    if scale > 1:
        image = cv2.GaussianBlur(image, (0, 0), 0.4 * scale)
    start = corner + scale / 2 - 0.5
    matrix = np.array([[scale, 0, start[0]], [0, scale, start[1]]])
    picture = cv2.warpAffine(image, matrix, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE,
                             flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    corners = np.array([box[0], box[1], box[0] + box[2], box[1] + box[3]])
    limits = np.array([0, 0, image.shape[1], image.shape[0]])
    place = np.tile(corner, 2)
    return _Window(picture, (corners - place) / scale,
                   np.clip((limits - place) / scale, 0, SIDE), scale, group)


def clip_windows(clips: Iterable[Clip], rng: np.random.Generator) -> Iterator[_Window]:
    """Yield windows of clips: around the target, or where it was last while it is absent."""
    for group, clip in enumerate(clips):
        present = clip.present
        if not len(present):
            continue
        middle = clip.box(int(present[0])).center
        for index in range(0, len(clip.frames), _CLIP_STRIDE):
            box = clip.boxes[index]
            if np.isfinite(box).all():
                target = BoundingBox(*box)
                middle = target.center
                scale = max(1.0, target.area**0.5 / _LARGEST_TARGET)
            around = np.array(middle) + rng.uniform(-0.1, 0.1, 2) * SIDE
            yield cut(clip.frames[index], box, around, scale, group)


def still_windows(stills: Iterable[Still], rng: np.random.Generator) -> Iterator[_Window]:
    """Yield a window of each still around one of its boxes."""
    for group, still in enumerate(stills):
        box = still.pick(rng)
        scale = max(1.0, box.area**0.5 / _LARGEST_TARGET)
        yield cut(still.image, np.array(box.as_tuple()), box.center, scale, group)


def texture_windows(stills: Iterable[Still], rng: np.random.Generator) -> Iterator[_Window]:
    """Yield a window of each still at a random place and scale."""
    nothing = np.full(4, np.nan)
    for group, still in enumerate(stills):
        size = np.array(still.image.shape[::-1])
        yield cut(still.image, nothing, rng.uniform(0.3, 0.7, 2) * size,
                  float(rng.uniform(0.8, max(1.0, size.min() / SIDE))), group)


def main() -> None:
    """Cut the windows of a data folder."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--data', type=data_folder('thermal_dev', 'training_stills'),
                        required=True)
    parser.add_argument('--output', type=Path, required=True)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    clips = load_clips(options.data / 'thermal_dev', 'train')
    stills = load_stills(options.data / 'training_stills')
    boxed = [still for still in stills if still.boxes]
    known = [clip for i, clip in enumerate(clips) if i % _VALIDATION_EVERY]
    write_windows(options.output, {
        'clips': list(clip_windows(known, rng)),
        'held_out': list(clip_windows(clips[::_VALIDATION_EVERY], rng)),
        'stills': [*still_windows(boxed, rng), *still_windows(boxed, rng)],
        'textures': list(texture_windows(stills, rng))})


if __name__ == '__main__':
    main()
