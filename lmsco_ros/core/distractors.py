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

"""Places of the image that look like the target and are known not to be it."""

from __future__ import annotations

from dataclasses import dataclass
import math

import cv2
import numpy as np

from lmsco_ros.core.detection import Detection
from lmsco_ros.core.types import BoundingBox

__all__ = ['Distractors', 'other_peaks']

_Point = tuple[float, float]

_SAME_PLACE = 0.75
_STRENGTH = 0.35
_MOST_KEPT = 3
_REMEMBERED_FRAMES = 60


def other_peaks(grid: np.ndarray, exclude: int, strength: float) -> list[_Point]:
    """
    Return the local maxima of a periodic score beside its maximum, the highest first.

    Parameters
    ----------
    grid : ndarray, shape (n, n)
        Scores; the origin is at [0, 0].
    exclude : int
        Half side, in grid points, of the square around the maximum in which none counts.
    strength : float
        Part of the maximum that they reach at least.

    Returns
    -------
    list of tuple of float
        Displacements (dy, dx) in periods, in [-1/2, 1/2).

    """
    size = grid.shape[0]
    row, column = np.unravel_index(np.argmax(grid), grid.shape)
    middle = size // 2
    # With the maximum in the middle, no wanted peak is split by the edge of the square alone.
    rolled = np.roll(grid, (middle - row, middle - column), axis=(0, 1)).astype(np.float32)
    framed = cv2.copyMakeBorder(rolled, 1, 1, 1, 1, cv2.BORDER_WRAP)
    highest = cv2.dilate(framed, np.ones((3, 3), np.uint8))[1:-1, 1:-1]
    found = (rolled >= highest) & (rolled >= strength * rolled[middle, middle])
    found[middle - exclude:middle + exclude + 1, middle - exclude:middle + exclude + 1] = False
    rows, columns = np.nonzero(found)
    order = np.argsort(-rolled[rows, columns], kind='stable')
    return [(_wrap((rows[i] - middle + row) / size), _wrap((columns[i] - middle + column) / size))
            for i in order]


def _wrap(t: float) -> float:
    """Move a position of the period to [-1/2, 1/2)."""
    return float((t + 0.5) % 1.0 - 0.5)


@dataclass
class _Place:
    """A distractor: where it was seen last, and how many frames ago it was told apart."""

    center: _Point
    age: int = 0


class Distractors:
    """
    Remembers the other strong peaks of frames in which the target was certain.

    When the target vanishes, the score of something similar beside it becomes the highest one.
    It stands where a peak stood all along, and away from where the target is expected: that
    tells it from a target that moves. A place that is not confirmed for two seconds is given
    up, since the target may get there.
    """

    def __init__(self) -> None:
        self._places: list[_Place] = []

    def __len__(self) -> int:
        """Return how many places are known."""
        return len(self._places)

    def explains(self, found: _Point, expected: BoundingBox) -> bool:
        """
        Return whether something found is a distractor rather than the target.

        Parameters
        ----------
        found : tuple of float
            Image position (x, y).
        expected : BoundingBox
            The target where it is expected.

        """
        return (not _same_place(found, expected.center, expected)
                and self._nearest(found, expected) is not None)

    def follow(self, found: _Point, box: BoundingBox) -> None:
        """Move the place that explains something found to where that is now."""
        place = self._nearest(found, box)
        if place is not None:
            place.center = found

    def grow_old(self) -> None:
        """Count a frame, and forget what was not seen beside the target for long."""
        for place in self._places:
            place.age += 1
        self._places = [p for p in self._places if p.age <= _REMEMBERED_FRAMES]

    def learn(self, detection: Detection, box: BoundingBox) -> None:
        """Take the other peaks of a frame in which the target is certain."""
        grid = detection.peak.grid
        exclude = math.ceil(_SAME_PLACE * grid.shape[0] * box.area**0.5 / detection.region.width)
        for displacement in other_peaks(grid, exclude, _STRENGTH)[:_MOST_KEPT]:
            center = detection.image_position(displacement)
            place = self._nearest(center, box)
            if place is None:
                self._places.append(_Place(center))
            else:
                place.center, place.age = center, 0
        self._places = [p for p in self._places if not _same_place(p.center, box.center, box)]
        self._places = sorted(self._places, key=lambda p: p.age)[:2 * _MOST_KEPT]

    def _nearest(self, center: _Point, box: BoundingBox) -> _Place | None:
        """Return the known place that a point belongs to."""
        near = [p for p in self._places if _same_place(p.center, center, box)]
        return min(near, key=lambda p: math.dist(p.center, center)) if near else None


def _same_place(one: _Point, other: _Point, box: BoundingBox) -> bool:
    """Return whether two points are less than three quarters of a target apart."""
    return math.dist(one, other) < _SAME_PLACE * box.area**0.5
