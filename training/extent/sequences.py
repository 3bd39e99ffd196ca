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
Rendered sequences with exact extents, to choose by: bodies that enter, turn, meet others.

    python -m training.extent.sequences --windows WINDOWS.npz --output FOLDER

FOLDER is then read by `lmsco evaluate FOLDER --protocol anchors` as any data set. No sequence is
trained on: each is a body, a background and a course of its own.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

from training.extent.bodies import Bodies, draw, edges, posed, sample_bodies, transformed
from training.extent.windows import read_windows, Windows

__all__ = ['KINDS', 'rendered_sequence', 'write_sequences']

KINDS = ('entering', 'view', 'crowd')

SIDE = 160
_FRAMES = 120
_POSE_FRAMES = 15
_COUNTS = 40.0


@dataclass(frozen=True)
class _Walk:
    """
    A body on its way.

    Attributes
    ----------
    poses : list of Bodies
        That it takes one after the other.
    start, end : tensor, shape (2,)
        Where it comes from and goes to, in pixels (x, y).
    unit, growth : float
        Pixels for a unit of its own at the start; its size at the end over that.
    facing : bool
        Whether it is mirrored.
    narrow : float
        Its width, when it shows its narrow side, as a part of that from the side.

    """

    poses: list[Bodies]
    start: torch.Tensor
    end: torch.Tensor
    unit: float
    growth: float
    facing: bool
    narrow: float

    @classmethod
    def of(cls, body: Bodies, side: float, entering: bool) -> _Walk:
        """Return a random walk of a body that has a side in pixels at its start."""
        poses = [posed(body, torch.tensor([0.07])) for _ in range(_FRAMES // _POSE_FRAMES + 2)]
        extent = edges(body)[0]
        start, end = _course(entering, side)
        return cls(poses, start, end, side / float((extent[2:] - extent[:2]).prod().sqrt()),
                   float(torch.exp(0.5 * torch.randn(1))), bool(torch.rand(1) < 0.5),
                   1 - 0.45 * float(torch.rand(1)))

    def at(self, index: int) -> tuple[Bodies, torch.Tensor, torch.Tensor]:
        """Return the body in a frame, its place and its scale."""
        part = index / (_FRAMES - 1)
        turned = 1 - (1 - self.narrow) * abs(np.sin(3 * np.pi * part))
        now = transformed(_between(self.poses, index / _POSE_FRAMES), torch.zeros(1),
                          torch.tensor([[turned, 1.0]]), torch.tensor([self.facing]))
        place = self.start + (self.end - self.start) * min(1.0, 1.5 * part)
        place = place + torch.tensor([4 * np.sin(9 * part), 2 * np.sin(17 * part)])
        return now, place[None].float(), torch.tensor([self.unit * self.growth**part])


def rendered_sequence(textures: Windows, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the frames of a body on its way, and its boxes.

    Parameters
    ----------
    textures : Windows
        One is the background.
    kind : str
        One of `KINDS`: it comes in over a border of the image, it is in view, or others of its
        kind walk beside it, behind it and before it.

    Returns
    -------
    frames : ndarray, shape (n, SIDE, SIDE), uint16
        Counts of a radiometric camera.
    boxes : ndarray, shape (n, 4)
        x, y, width, height of what is visible; NaN where that is less than two pixels.

    """
    body = sample_bodies(1, torch.device('cpu'))
    side = float(12 * 4**torch.rand(1))
    target = _Walk.of(body, side, kind == 'entering')
    others = [_Walk.of(body, side, False) for _ in range(4 if kind == 'crowd' else 0)]
    scene, contrast = _background(textures), float(4**torch.rand(1))
    frames, boxes = [], []
    for index in range(_FRAMES):
        picture = scene
        for walk in (*others[:2], target, *others[2:]):
            now, place, scale = walk.at(index)
            cover, heat = draw(now, place, scale, torch.tensor([0.8]), SIDE)
            picture = picture * (1 - cover[0]) + cover[0] * contrast * heat[0]
            if walk is target:
                boxes.append(_visible(edges(now)[0] * scale + place[0].repeat(2)))
        noisy = picture + 0.08 * torch.randn(SIDE, SIDE)
        frames.append((8000 + _COUNTS * noisy).round().numpy().astype(np.uint16))
    return np.stack(frames), np.array(boxes)


def write_sequences(textures: Windows, folder: Path, count: int, seed: int) -> None:
    """Write sequences of all kinds in turn, each in a folder of its own."""
    torch.manual_seed(seed)
    for number in range(count):
        kind = KINDS[number % len(KINDS)]
        frames, boxes = rendered_sequence(textures, kind)
        place = folder / 'rendered' / f'{kind}_{number:02d}'
        (place / 'ir').mkdir(parents=True, exist_ok=True)
        for index, frame in enumerate(frames):
            cv2.imwrite(str(place / 'ir' / f'{index:05d}.png'), frame)
        np.savetxt(place / 'groundtruth.txt', boxes, '%.2f', ',')


def _course(entering: bool, side: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Return where a body starts and where it stops, in pixels (x, y)."""
    end = SIDE * (0.3 + 0.4 * torch.rand(2))
    start = SIDE * (0.25 + 0.5 * torch.rand(2))
    if entering:
        axis, far = int(torch.randint(2, (1,))), bool(torch.rand(1) < 0.5)
        start[axis] = SIDE - 1 + 0.2 * side if far else 1 - 0.2 * side
    return start, end


def _between(poses: list[Bodies], place: float) -> Bodies:
    """Return a body between two poses that follow each other."""
    before, after = poses[int(place)], poses[int(place) + 1]
    part = 0.5 - 0.5 * np.cos(np.pi * (place - int(place)))
    return Bodies(*(a if a.dtype == torch.bool else torch.lerp(a, b, float(part))
                    for a, b in zip(vars(before).values(), vars(after).values(), strict=True)))


def _background(textures: Windows) -> torch.Tensor:
    """Return a background of at most unit contrast."""
    image = textures.images[torch.randint(len(textures), (1,))].float()
    image = torch.nn.functional.interpolate(image[None], (SIDE, SIDE), mode='bilinear')[0, 0]
    image = (image - image.mean()) / (image.std() + 1)
    return 0.8 * float(torch.rand(1)) * image


def _visible(box: torch.Tensor) -> np.ndarray:
    """Return what is visible of a box as (x, y, width, height); NaN for next to nothing."""
    low, high = box[:2].clamp(0, SIDE), box[2:].clamp(0, SIDE)
    size = high - low
    if float(size.min()) < 2:
        return np.full(4, np.nan)
    return torch.cat([low, size]).numpy()


def main() -> None:
    """Write the sequences."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--windows', type=Path, required=True)
    parser.add_argument('--output', type=Path, required=True)
    parser.add_argument('--count', type=int, default=36)
    parser.add_argument('--seed', type=int, default=20)
    options = parser.parse_args()
    write_sequences(read_windows(options.windows, 'textures'), options.output, options.count,
                    options.seed)


if __name__ == '__main__':
    main()
