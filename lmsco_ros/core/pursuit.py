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

"""Where a target that is missing is looked for."""

from __future__ import annotations

from lmsco_ros.core.sampling import search_tiles
from lmsco_ros.core.types import BoundingBox

__all__ = ['Pursuit']

_Point = tuple[float, float]

_SMOOTHING = 0.3
_DAMPING = 0.7


class Pursuit:
    """
    Predicts where a target is that is not seen, and in which order the image is searched.

    The target goes on with its mean velocity of the last frames, which fades, so that the
    prediction comes to rest after about three frames' way. The search spreads from there over
    the whole image, a slice of it in every frame, and starts over.

    Parameters
    ----------
    tiles : int
        Regions in a slice.

    """

    def __init__(self, tiles: int) -> None:
        self._tiles = tiles
        self._last: _Point | None = None
        self._velocity = (0.0, 0.0)
        self._order: list[_Point] = []
        self._next = 0
        self._misses = 0

    @property
    def misses(self) -> int:
        """Number of frames since the target was seen."""
        return self._misses

    def seen(self, center: _Point) -> None:
        """Take note of where the target is in this frame."""
        if self._last is not None and not self._misses:
            step = (center[0] - self._last[0], center[1] - self._last[1])
            self._velocity = (self._velocity[0] + _SMOOTHING * (step[0] - self._velocity[0]),
                              self._velocity[1] + _SMOOTHING * (step[1] - self._velocity[1]))
        elif self._misses:
            self._velocity = (0.0, 0.0)
        self._last, self._order, self._misses = center, [], 0

    def cut(self) -> None:
        """Take note that the view has changed: the target does not go on as it did."""
        self._velocity, self._order = (0.0, 0.0), []

    def missed(self) -> None:
        """Take note of a frame in which the target was not seen."""
        self._misses += 1

    def expected(self, box: BoundingBox, image_size: tuple[int, int]) -> BoundingBox:
        """
        Return the box where the target is expected in this frame, its center in the image.

        Parameters
        ----------
        box : BoundingBox
            Where it was seen last.
        image_size : tuple of int
            Width and height in pixels.

        """
        ahead = (1 - _DAMPING**self._misses) / (1 - _DAMPING)
        x, y = (min(max(c + ahead * v, 0.0), float(length)) for c, v, length in zip(
            box.center, self._velocity, image_size, strict=True))
        return box.moved_to((x, y))

    def slice(self, image_size: tuple[int, int], side: float, around: _Point,
              slices: int = 1) -> list[_Point]:
        """
        Return the centers of the regions to be searched in this frame.

        Parameters
        ----------
        image_size : tuple of int
            Width and height in pixels.
        side : float
            Side of a region.
        around : tuple of float
            Where the search begins, if it does so in this frame.
        slices : int
            How many slices at once.

        """
        if not self._order:
            self._order, self._next = search_tiles(image_size, side, around), 0
        count = min(slices * self._tiles, len(self._order))
        first, self._next = self._next, self._next + count
        return [self._order[(first + i) % len(self._order)] for i in range(count)]
