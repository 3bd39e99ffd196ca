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

from enum import Enum

from lmsco_ros.core.config import SearchConfig
from lmsco_ros.core.imaging.regions import search_tiles

__all__ = ['Schedule', 'Turn']

_Point = tuple[float, float]

# Searches in which all salient places get their turn.
_TURNS = 3


class Turn(Enum):
    """Where a target that has been lost for a while is looked for in a frame."""

    NEAR = 'at what is salient around the last place'
    AHEAD = 'at what is salient around the place to which its motion has led'
    ANYWHERE = 'at what is salient in the whole image'
    TILES = 'in a slice of the image'


_SALIENT_TURNS = (Turn.NEAR, Turn.AHEAD, Turn.ANYWHERE)


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

    def salient(self, misses: int) -> range:
        """Return which of the salient places are looked at so many frames after a sight."""
        first = misses % _TURNS * self._config.candidates
        return range(first, first + self._config.candidates)

    def turn(self, misses: int) -> Turn:
        """Return where a lost target is looked for, so many frames after it was seen."""
        if misses % 2:
            return Turn.TILES
        return _SALIENT_TURNS[misses // 2 % len(_SALIENT_TURNS)]

    def measured(self, misses: int) -> range:
        """Return which of the salient places are measured when these have their turn."""
        count = -(-self._config.candidates // 2)
        turns = -(-self.candidates // count) if count else 1
        first = misses // (2 * len(_SALIENT_TURNS)) % turns * count
        return range(first, first + count)

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
