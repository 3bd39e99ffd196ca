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

"""Pairs of patches: a target, and the target again or something that is not it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.evaluation.challenges.regions import without_region
from training.degradations import degrade, occlude
from training.examples import Array, flip, jitter, moved, Spread
from training.sources import Clip, Still

__all__ = ['KINDS', 'PairSource']

KINDS = ('present', 'near', 'erased', 'other')
"""The target; the background near it; its place without it; another target."""

_Sight = tuple[FrameView, BoundingBox]

# Sides of the crop over those of the target in which the target is erased.
_ERASED_CROP = 4.0


class PairSource:
    """
    Draws pairs of patches at random.

    Parameters
    ----------
    clips : sequence of Clip
        Real motion and change of appearance.
    stills : sequence of Still
        Images that are set moving.
    size : int
        Side of the patches.
    context : float
        Sides of a patch over those of its target.
    clip_share : float
        Share of the pairs that come from clips.
    present : Spread
        How far the box may be off that the patch of a present target is laid around.
    near : tuple of float
        Least and largest distance of background from the target, in sides of the target.

    """

    def __init__(self, clips: Sequence[Clip], stills: Sequence[Still], size: int, context: float,
                 clip_share: float, present: Spread, near: tuple[float, float]) -> None:
        self._clips, self._stills = clips, stills
        self._size, self._context = size, context
        self._clip_share = clip_share if stills else 1.0
        self._present, self._near = present, near

    def draw(self, kind: str, rng: np.random.Generator) -> tuple[Array, bool]:
        """
        Return a pair and whether its second patch shows the target of the first.

        Parameters
        ----------
        kind : str
            One of `KINDS`.
        rng : Generator
            Source of chance.

        Returns
        -------
        patches : ndarray, shape (2, S, S), float32
            Intensities in the working range.
        present : bool
            Whether the second one shows the target.

        """
        first, (view, box) = self._sights(rng)
        if kind == 'other':
            view, box = self._sights(rng)[1]
        elif kind == 'erased':
            view, box = _erased(view, box, rng)
        elif kind == 'near':
            box = self._beside(box, rng)
        box = jitter(box, self._present, rng)
        patches = [degrade(self._patch(*first), rng), self._patch(view, box)]
        if kind == 'present' and rng.random() < 0.15:
            patches[1] = occlude(patches[1], self._size / self._context, rng)
        patches[1] = degrade(patches[1], rng)
        return flip(np.stack(patches), rng), kind == 'present'

    def _patch(self, view: FrameView, box: BoundingBox) -> Array:
        """Return what is in and around a box."""
        region = BoundingBox.from_center(
            box.center, (self._context * box.width, self._context * box.height))
        return view.patch(region, (self._size, self._size))

    def _sights(self, rng: np.random.Generator) -> tuple[_Sight, _Sight]:
        """Return a target in a first frame and in another one."""
        if rng.random() >= self._clip_share:
            still = self._stills[rng.integers(len(self._stills))]
            view, box = still.view(), still.pick(rng)
            return (view, box), moved(view, box, rng)
        clip = self._clips[rng.integers(len(self._clips))]
        present = clip.present
        # Half of the pairs are near in time, half may be a whole clip apart.
        reach = int(rng.integers(2, 120)) if rng.random() < 0.5 else len(present)
        start = int(rng.integers(len(present)))
        one, other = rng.choice(present[max(0, start - reach):start + reach], 2)
        return ((clip.view(int(one)), clip.box(int(one))),
                (clip.view(int(other)), clip.box(int(other))))

    def _beside(self, box: BoundingBox, rng: np.random.Generator) -> BoundingBox:
        """Return a box of the same size that does not hold the target."""
        angle = rng.uniform(0, 2 * np.pi)
        reach = np.array([np.cos(angle), np.sin(angle)]) * rng.uniform(*self._near)
        # Measured on the sides, so that a slim target is left behind in either direction.
        reach /= max(np.abs(np.array([np.cos(angle), np.sin(angle)])))
        return box.moved_to((box.center[0] + reach[0] * box.width,
                             box.center[1] + reach[1] * box.height))


def _erased(view: FrameView, box: BoundingBox, rng: np.random.Generator) -> _Sight:
    """Return the surroundings of a target with background in its place, and that place."""
    wide, high = _ERASED_CROP * box.width + 24, _ERASED_CROP * box.height + 24
    x0, y0 = max(0, int(box.center[0] - wide / 2)), max(0, int(box.center[1] - high / 2))
    crop = np.ascontiguousarray(view.image[y0:y0 + int(high), x0:x0 + int(wide)])
    inside = np.array([box.x - x0, box.y - y0, box.width, box.height])
    # Inpainting takes time with the area: large targets are erased in a smaller image.
    shrink = min(1.0, 40 / box.area**0.5)
    small = cv2.resize(crop, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    ratio = np.array([small.shape[1] / crop.shape[1], small.shape[0] / crop.shape[0]])
    scaled = inside * np.tile(ratio, 2)
    return (FrameView(_filled(small, scaled, rng), view.intensity), BoundingBox(*scaled))


def _filled(image: npt.NDArray[np.uint8], box: npt.NDArray[np.float64],
            rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return an image without what is in a box: inpainted, or covered with its neighborhood."""
    if rng.random() < 0.5:
        return without_region(image, box, rng)
    size = np.ceil(1.5 * box[2:] + 2).astype(int)
    center = box[:2] + box[2:] / 2
    side = (-1, 1)[rng.integers(2)] * np.eye(2)[rng.integers(2)]
    source = np.array(center + side * size, np.float32) - 0.5
    patch = cv2.getRectSubPix(image, size.tolist(), source.tolist()).astype(np.float32)
    edge = np.hanning(size[1] + 2)[1:-1, None] * np.hanning(size[0] + 2)[None, 1:-1]
    alpha = np.clip(6 * edge, 0, 1).astype(np.float32)
    corner = np.round(center - size / 2).astype(int)
    result = image.astype(np.float32)
    low, high = np.maximum(corner, 0), np.minimum(corner + size, image.shape[::-1])
    if (high <= low).any():
        return image
    part = np.s_[low[1]:high[1], low[0]:high[0]]
    own = np.s_[low[1] - corner[1]:high[1] - corner[1], low[0] - corner[0]:high[0] - corner[0]]
    result[part] += alpha[own] * (patch[own] - result[part])
    return np.round(result).astype(np.uint8)
