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

"""In which order an image is searched, a part of it in every frame."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config import SearchConfig
from lmsco_ros.core.imaging.regions import search_tiles

__all__ = ['Schedule', 'Turn']

_Point = tuple[float, float]

# Searches in which all salient places get their turn; odd, since later every other frame has one.
_TURNS = 3


@dataclass(frozen=True)
class Turn:
    """
    What is searched in a frame.

    Attributes
    ----------
    salient : range
        Which of the salient places, in the order of their salience.
    slices : int
        How many slices of the image.

    """

    salient: range
    slices: int


class Schedule:
    """
    Takes salient places and slices of the image in turns.

    The search for slices spreads from where the target is expected over the whole image, and
    starts over.

    Parameters
    ----------
    config : SearchConfig
        Salient places and regions of the image that are searched in one frame.

    """

    def __init__(self, config: SearchConfig) -> None:
        self._config = config
        self._order: list[_Point] = []
        self._next = 0

    @property
    def candidates(self) -> int:
        """How many salient places there are turns for."""
        return _TURNS * self._config.candidates

    def restart(self) -> None:
        """Begin the search anew, from where the target is expected then."""
        self._order = []

    def turn(self, misses: int, *, hurried: bool, after_shutter: bool) -> Turn:
        """
        Return what is searched in a frame.

        Parameters
        ----------
        misses : int
            Frames since the target was seen.
        hurried : bool
            Whether both are searched; in the long run they take turns, so that a frame without
            the target costs less.
        after_shutter : bool
            Whether the target may have got further than in one frame, behind a closed shutter.

        """
        first = misses % _TURNS * self._config.candidates
        salient = range(first, first + self._config.candidates)
        slices = 2 if after_shutter else 1
        if hurried:
            return Turn(salient, slices)
        return Turn(range(0), slices) if misses % 2 else Turn(salient, 0)

    def tiles(self, image_size: tuple[int, int], side: float, around: _Point,
              slices: int) -> list[_Point]:
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
        count = min(slices * self._config.tiles, len(self._order))
        first, self._next = self._next, self._next + count
        return [self._order[(first + i) % len(self._order)] for i in range(count)]
