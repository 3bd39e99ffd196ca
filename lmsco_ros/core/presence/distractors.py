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

"""Things in the image that look like the target and are known not to be it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.presence.evidence import JUMP
from lmsco_ros.core.types import BoundingBox

__all__ = ['Distractors']

_Point = tuple[float, float]
_Resemblance = Callable[[FrameView, BoundingBox], bool]

# How far a distractor gets in a frame, in sides of the target.
_SAME_PLACE = 0.75
_REMEMBERED_FRAMES = 60
_COPIED_BYTES = 1 << 20


@dataclass
class _Place:
    """A distractor: where it was seen last, and how many frames ago it was told apart."""

    center: _Point
    age: int = 0


class Distractors:
    """
    Tells another target from the one that is followed by where it was before.

    What is found away from where the target was seen last was either not there in the last frame
    in which the target was certain, and then the target may have jumped; or it was there, while
    the target was elsewhere. Such a place is followed from then on and forgotten after two
    seconds, since the target may get there.
    """

    def __init__(self) -> None:
        self._places: list[_Place] = []
        self._view: FrameView | None = None
        self._box: BoundingBox | None = None
        self._age = 0

    @property
    def places(self) -> list[_Point]:
        """Where the known ones were seen last, in image pixels."""
        return [place.center for place in self._places]

    def certain(self, view: FrameView, box: BoundingBox) -> None:
        """Keep a frame in which the target is certain; large ones only now and then."""
        if self._view is None or self._age >= view.image.nbytes / _COPIED_BYTES:
            self._view, self._box, self._age = view.copied(), box, 0

    def forget(self) -> None:
        """Forget all places: the view has changed."""
        self._view, self._places = None, []

    def next_frame(self) -> None:
        """Count a frame, and forget what is too old to say anything."""
        self._age += 1
        if self._age > _REMEMBERED_FRAMES:
            self._view = None
        for place in self._places:
            place.age += 1
        self._places = [place for place in self._places if place.age <= _REMEMBERED_FRAMES]

    def explain(self, found: _Point, last: BoundingBox, resembles: _Resemblance) -> bool:
        """
        Return whether something found is a distractor; if so, note its place.

        Parameters
        ----------
        found : tuple of float
            Image position (x, y).
        last : BoundingBox
            The target where it was seen last.
        resembles : callable
            Returns whether a frame shows something like the target in a box.

        """
        side, jump = last.area**0.5, math.dist(found, last.center)
        near = [place for place in self._places
                if math.dist(place.center, found) < min(_SAME_PLACE * side, jump)]
        if near:
            min(near, key=lambda place: math.dist(place.center, found)).center = found
            return True
        if jump < JUMP * side or not self._was_there(last.moved_to(found), resembles):
            return False
        self._places.append(_Place(found))
        return True

    def _was_there(self, box: BoundingBox, resembles: _Resemblance) -> bool:
        """Return whether the kept frame shows the like, while the target was elsewhere."""
        if self._view is None or self._box is None:
            return False
        apart = math.dist(box.center, self._box.center) >= JUMP * box.area**0.5
        return apart and resembles(self._view, box)
