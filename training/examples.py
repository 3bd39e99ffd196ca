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

"""Drawing of training examples: one target, seen in several search regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox
from training.degradations import degrade, occlude
from training.sources import Clip, Still

__all__ = ['Example', 'ExampleSource', 'flip', 'jitter', 'moved', 'offset_of', 'Spread']

Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Spread:
    """
    How far a search region may be off its target.

    Attributes
    ----------
    shift : float
        Largest offset of the center, in sides of the target.
    scale : float
        Standard deviation of the logarithm of the size.
    aspect : float
        Standard deviation of the logarithm of the aspect ratio.

    """

    shift: float
    scale: float
    aspect: float


@dataclass(frozen=True)
class Example:
    """
    Search regions of one target.

    Attributes
    ----------
    patches : ndarray, shape (n, S, S), float32
        Intensities in the working range; the target is in the middle of the first.
    offsets : ndarray, shape (n, 4), float32
        Center (x, y) of the target from the middle of the region, in sides of the region over
        the factor, and logarithms of its width and height over those of the box that the region
        was laid around.

    """

    patches: Array
    offsets: Array


class ExampleSource:
    """
    Draws examples at random.

    Parameters
    ----------
    clips : sequence of Clip
        Real motion.
    stills : sequence of Still
        Images that are set moving.
    size : int
        Side of the patches.
    factor : float
        Side of a region over the side of its target; see `regions`.
    square : bool
        Whether regions are square, as the filter's, or have the shape of the target.
    clip_share : float
        Share of the examples that come from clips.
    bystanders : int
        Largest number of other targets beside the one that is meant, in square regions.

    """

    def __init__(self, clips: Sequence[Clip], stills: Sequence[Still], size: int, factor: float,
                 square: bool, clip_share: float, bystanders: int = 0) -> None:
        self._clips, self._stills = clips, stills
        self._bystanders = (0, bystanders + 1)
        self._size, self._factor, self._square = size, factor, square
        self._clip_share = clip_share if stills else 1.0

    def draw(self, count: int, known: Spread, searched: Spread,
             rng: np.random.Generator) -> Example:
        """
        Return an example of `count` regions.

        Parameters
        ----------
        count : int
            Regions.
        known, searched : Spread
            How far the first regions, and the last one, are off the target.
        rng : Generator
            Source of chance.

        """
        real = rng.random() < self._clip_share
        sights = self._from_clip(count, rng) if real else self._from_still(count, rng)
        elsewhere = None if real or rng.random() < 0.4 else self._elsewhere(sights[0][1], rng)
        others = [self._bystander(rng) for _ in range(rng.integers(*self._bystanders))]
        inverted = rng.random() < 0.5
        patches, offsets = [], []
        for i, (view, box) in enumerate(sights):
            last = i == count - 1
            guess = jitter(box, searched if last else known, rng)
            patch = self._patch(view, guess)
            if elsewhere is not None:
                patch = self._transplant(patch, box, guess, elsewhere, rng)
            middle = self._middle(box, guess)
            for other in others:
                patch = self._beside(patch, middle, other, rng)
            if last and rng.random() < 0.1:
                patch = occlude(patch, self._size / self._factor, rng)
            patch = degrade(patch, rng)
            patches.append(1 - patch if inverted else patch)
            offsets.append(offset_of(box, guess, self._sides(guess)))
        return _flip(Example(np.stack(patches), np.array(offsets, np.float32)), rng)

    def _patch(self, view: FrameView, box: BoundingBox) -> Array:
        """Return the search region around a box."""
        width, height = self._sides(box)
        region = BoundingBox.from_center(
            box.center, (self._factor * width, self._factor * height))
        return view.patch(region, (self._size, self._size))

    def _sides(self, box: BoundingBox) -> tuple[float, float]:
        """Return the sides of the region around a box, over the factor."""
        return (box.area**0.5,) * 2 if self._square else box.size

    def _elsewhere(self, box: BoundingBox,
                   rng: np.random.Generator) -> tuple[FrameView, BoundingBox]:
        """Return another image, and a box of the same size in it."""
        still = self._stills[rng.integers(len(self._stills))]
        height, width = still.image.shape
        center = (rng.uniform(0, width), rng.uniform(0, height))
        return still.view(), BoundingBox.from_center(center, box.size)

    def _transplant(self, patch: Array, box: BoundingBox, guess: BoundingBox,
                    elsewhere: tuple[FrameView, BoundingBox], rng: np.random.Generator) -> Array:
        """Return the target in a patch before another background, near where that was before."""
        view, place = elsewhere
        drift = rng.normal(0, 0.5, 2) * box.area**0.5
        background = self._patch(view, BoundingBox.from_center(
            (place.center[0] + drift[0], place.center[1] + drift[1]), guess.size))
        sides = np.array(self._sides(guess)) * self._factor
        mask = _ellipse(self._size, self._middle(box, guess),
                        0.6 * self._size * np.array(box.size) / sides)
        return background + mask * (patch - background)

    def _middle(self, box: BoundingBox, guess: BoundingBox) -> npt.NDArray[np.float64]:
        """Return where, in pixels (x, y) of the patch around the guess, the box has its middle."""
        sides = np.array(self._sides(guess)) * self._factor
        away = (np.array(box.center) - np.array(guess.center)) / sides
        return self._size * (0.5 + away) - 0.5

    def _bystander(self, rng: np.random.Generator) -> tuple[Array, float]:
        """Return the patch of another target, and its height over its width."""
        if not self._stills or rng.random() < self._clip_share:
            (view, box), = self._from_clip(1, rng)
        else:
            (view, box), = self._from_still(1, rng)
        return self._patch(view, box), box.height / box.width

    def _beside(self, patch: Array, middle: npt.NDArray[np.float64], other: tuple[Array, float],
                rng: np.random.Generator) -> Array:
        """Return the patch with another target, as bright as the one in its middle, beside it."""
        side = self._size / self._factor
        turn, reach = rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 2.4) * side
        place = np.round(middle + reach * np.array([np.cos(turn), np.sin(turn)])).astype(int)
        radii = 0.6 * side * np.array([other[1]**-0.5, other[1]**0.5])
        home = (self._size - 1) // 2
        moved = np.roll(other[0], (place[1] - home, place[0] - home), axis=(0, 1))
        mask = _ellipse(self._size, place, radii)
        target = _ellipse(self._size, middle, (side / 2, side / 2))
        mean, spread = _moments(patch, target)
        other_mean, other_spread = _moments(moved, mask)
        alike = (moved - other_mean) * (spread / (other_spread + 0.02)) + mean
        return (patch + mask * (alike - patch)).astype(np.float32)

    def _from_clip(self, count: int,
                   rng: np.random.Generator) -> list[tuple[FrameView, BoundingBox]]:
        """Return frames of one clip, at most some seconds apart, in any order."""
        clip = self._clips[rng.integers(len(self._clips))]
        present = clip.present
        reach = int(rng.integers(2, 120))
        start = int(rng.integers(len(present)))
        near = present[max(0, start - reach):start + reach]
        chosen = rng.choice(near, count, replace=len(near) < count)
        return [(clip.view(int(i)), clip.box(int(i))) for i in chosen]

    def _from_still(self, count: int,
                    rng: np.random.Generator) -> list[tuple[FrameView, BoundingBox]]:
        """Return one image, turned and stretched around one of its targets."""
        still = self._stills[rng.integers(len(self._stills))]
        box = still.pick(rng)
        view = still.view()
        return [(view, box)] + [moved(view, box, rng) for _ in range(count - 1)]


def _ellipse(size: int, middle: npt.ArrayLike, radii: npt.ArrayLike) -> Array:
    """Return a mask, shape (size, size), that falls softly from 1 to 0 around an ellipse."""
    axis = np.arange(size)
    (x, y), (width, height) = middle, radii
    away = np.hypot((axis[None, :] - x) / width, (axis[:, None] - y) / height)
    return np.clip((1.15 - away) / 0.3, 0, 1).astype(np.float32)


def _moments(patch: Array, mask: Array) -> tuple[float, float]:
    """Return mean and standard deviation under a mask."""
    total = float(mask.sum()) + 1e-6
    mean = float((patch * mask).sum()) / total
    return mean, float(np.sqrt(((patch - mean)**2 * mask).sum() / total))


def jitter(box: BoundingBox, spread: Spread, rng: np.random.Generator) -> BoundingBox:
    """Return a box that is a bit off."""
    side = box.area**0.5
    shift = rng.uniform(-spread.shift, spread.shift, 2) * side
    scale = np.exp(rng.normal(0, spread.scale))
    stretch = np.exp(rng.normal(0, spread.aspect / 2))
    center = (box.center[0] + shift[0], box.center[1] + shift[1])
    return BoundingBox.from_center(
        center, (box.width * scale * stretch, box.height * scale / stretch))


def offset_of(box: BoundingBox, guess: BoundingBox,
              sides: tuple[float, float]) -> tuple[float, float, float, float]:
    """Return where a box is from the guess, in `sides`, and its size over that of the guess."""
    return ((box.center[0] - guess.center[0]) / sides[0],
            (box.center[1] - guess.center[1]) / sides[1],
            float(np.log(box.width / guess.width)), float(np.log(box.height / guess.height)))


def moved(view: FrameView, box: BoundingBox,
          rng: np.random.Generator) -> tuple[FrameView, BoundingBox]:
    """Return the image turned a little around the target and stretched, with the new box."""
    turn = np.deg2rad(rng.normal(0, 6))
    stretch = np.exp(rng.normal(0, 0.15) + rng.normal(0, 0.08, 2))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    linear = rotation @ np.diag(stretch)
    # OpenCV counts from the middle of the first pixel.
    center = np.array(box.center) - 0.5
    matrix = np.column_stack([linear, center - linear @ center])
    image = cv2.warpAffine(view.image, matrix, view.size, flags=cv2.INTER_LINEAR,
                           borderMode=cv2.BORDER_REFLECT)
    if rng.random() < 0.5:
        image = _bent(image, box, rng)
    size = (box.width * stretch[0], box.height * stretch[1])
    return FrameView(image, view.intensity), BoundingBox.from_center(box.center, size)


def _bent(image: npt.NDArray[np.uint8], box: BoundingBox,
          rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the image bent smoothly around a box, as a walking person bends."""
    width, height = (int(np.ceil(2 * side)) for side in box.size)
    x, y = (int(round(c - side / 2)) for c, side in zip(box.center, (width, height), strict=True))
    field = cv2.resize(rng.normal(0, 0.06 * box.area**0.5, (4, 4, 2)).astype(np.float32),
                       (width, height), interpolation=cv2.INTER_CUBIC)
    fade = np.hanning(width + 2)[None, 1:-1] * np.hanning(height + 2)[1:-1, None]
    field *= fade[:, :, None].astype(np.float32)
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    result = image.copy()
    bent = cv2.remap(image, (x + columns + field[..., 0]).astype(np.float32),
                     (y + rows + field[..., 1]).astype(np.float32), cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_REPLICATE)
    top, left = max(y, 0), max(x, 0)
    inside = result[top:y + height, left:x + width]
    inside[:] = bent[top - y:, left - x:][:inside.shape[0], :inside.shape[1]]
    return result


def _flip(example: Example, rng: np.random.Generator) -> Example:
    """Return the example or one of its mirror images."""
    patches, offsets = example.patches, example.offsets.copy()
    if rng.random() < 0.5:
        patches, offsets[:, 0] = patches[:, :, ::-1], -offsets[:, 0]
    if rng.random() < 0.5:
        patches, offsets[:, 1] = patches[:, ::-1], -offsets[:, 1]
    return Example(np.ascontiguousarray(patches), offsets)


def flip(patches: Array, rng: np.random.Generator) -> Array:
    """Return patches (n, S, S), or one of their mirror images, warm and cold as chance has it."""
    if rng.random() < 0.5:
        patches = patches[:, :, ::-1]
    if rng.random() < 0.5:
        patches = patches[:, ::-1]
    return np.ascontiguousarray(1 - patches if rng.random() < 0.5 else patches)
