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

"""Other targets that are followed as well: what is theirs is not this one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ['Neighbors']

_Point = tuple[float, float]

# How far from where another target is expected its detection may lie, in sides of a target.
_REACH = 0.75
# How near to each other targets are of which nobody can tell what is whose, in the same.
_MERGED = 0.5
# How near targets are that may be measured as one: the extent network sees one and a half sides
# around a target.
_TOUCHING = 1.5


@dataclass(frozen=True)
class Neighbors:
    """
    Where the target and the others go; a place belongs to the one that is expected nearest.

    Attributes
    ----------
    own : tuple of float
        Where (x, y) the target gets to in this frame if it goes on as before.
    others : tuple of tuple of float
        The same of the others.

    """

    own: _Point
    others: tuple[_Point, ...]

    def claim(self, found: _Point, side: float) -> bool:
        """Return whether something found is another target's; a side has `side` pixels."""
        place = np.array(found)
        return bool(self._distances(place).min() < _REACH * side and not self.owned(place))

    def merged(self, side: float) -> bool:
        """Return whether another target gets to the same place; a side has `side` pixels."""
        return self._nearest < _MERGED * side

    def touched(self, side: float) -> bool:
        """Return whether another target gets so near that what is measured may be of both."""
        return self._nearest < _TOUCHING * side

    @property
    def _nearest(self) -> float:
        """How far the nearest of the others is, in pixels."""
        return float(self._distances(np.array(self.own)).min())

    def owned(self, places: np.ndarray) -> np.ndarray:
        """Return which of the places, shape (..., 2), are expected to be the target's."""
        own = np.linalg.norm(places - np.array(self.own), axis=-1)
        return own <= self._distances(places).min(axis=-1)

    def _distances(self, places: np.ndarray) -> np.ndarray:
        """Return how far places, shape (..., 2), are from the others, shape (..., n)."""
        others = np.array(self.others)
        return np.linalg.norm(places[..., None, :] - others, axis=-1)
