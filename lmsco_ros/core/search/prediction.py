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

"""Where a target goes that is not seen."""

from __future__ import annotations

from lmsco_ros.core.types import BoundingBox

__all__ = ['Prediction']

_Point = tuple[float, float]

_SMOOTHING = 0.3
_DAMPING = 0.7


class Prediction:
    """
    Predicts where a target is that is not seen.

    The target goes on with its mean velocity of the last frames, which fades, so that the
    prediction comes to rest after about three frames' way.
    """

    def __init__(self) -> None:
        self._last: _Point | None = None
        self._velocity = (0.0, 0.0)
        self._misses = 0

    @property
    def misses(self) -> int:
        """Number of frames since the target was seen."""
        return self._misses

    @property
    def velocity(self) -> _Point:
        """Mean way (x, y) of a frame, in pixels."""
        return self._velocity

    def seen(self, center: _Point, merged: bool = False) -> None:
        """
        Take note of where the target is in this frame.

        Parameters
        ----------
        center : tuple of float
            Where (x, y) it is.
        merged : bool
            Whether another target is in the same place: what is seen there is of both and goes
            the way of none of them. This one is expected to go on as before.

        """
        if self._misses:
            self._velocity = (0.0, 0.0)
        elif self._last is not None and not merged:
            step = (center[0] - self._last[0], center[1] - self._last[1])
            self._velocity = (self._velocity[0] + _SMOOTHING * (step[0] - self._velocity[0]),
                              self._velocity[1] + _SMOOTHING * (step[1] - self._velocity[1]))
        self._last, self._misses = center, 0

    def missed(self) -> None:
        """Take note of a frame in which the target was not seen."""
        self._misses += 1

    def stop(self) -> None:
        """Take note that the view has changed: the target does not go on as it did."""
        self._velocity = (0.0, 0.0)

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
