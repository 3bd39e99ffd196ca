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

"""Plain values that enter and leave the tracker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
import math
import reprlib

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.errors import BoxError


@dataclass(frozen=True)
class BoundingBox:
    """
    Axis-aligned box in image pixels; pixel (0, 0) covers [0, 1) x [0, 1).

    Parameters
    ----------
    x, y : float
        Top-left corner, in pixels.
    width, height : float
        Size in pixels, both positive.

    Raises
    ------
    BoxError
        When one is no number or not finite, or a side is not positive.

    """

    x: float
    y: float
    width: float
    height: float

    def __post_init__(self) -> None:
        """Refuse boxes that enclose no area."""
        if not _finite(self.as_tuple()):
            raise BoxError(f'box {self.as_tuple()} has a number that is not finite; '
                           'give four finite numbers x, y, width, height in pixels')
        if self.width <= 0 or self.height <= 0:
            raise BoxError(f'box {self.as_tuple()} is empty; '
                           'width and height must be positive (in pixels)')

    @classmethod
    def of(cls, box: BoundingBox | Sequence[float] | np.ndarray) -> BoundingBox:
        """
        Return a box that is given as such, or as four numbers.

        Parameters
        ----------
        box : BoundingBox, or tuple, list or array of four numbers
            (x, y, width, height) in pixels.

        Raises
        ------
        BoxError
            When it is anything else.

        """
        if isinstance(box, BoundingBox):
            return box
        numbers = box.tolist() if isinstance(box, np.ndarray) else box
        if isinstance(numbers, (tuple, list)) and len(numbers) == 4 and _finite(numbers):
            return cls(*map(float, numbers))
        raise BoxError(f'box {reprlib.repr(box)} is a {type(box).__name__}; expected a '
                       'BoundingBox, or (x, y, width, height): four finite numbers in pixels')

    @classmethod
    def from_center(cls, center: tuple[float, float],
                    size: tuple[float, float]) -> BoundingBox:
        """Return the box of `size` (width, height) around `center` (x, y)."""
        return cls(center[0] - size[0] / 2, center[1] - size[1] / 2, size[0], size[1])

    @property
    def center(self) -> tuple[float, float]:
        """Center (x, y) in pixels."""
        return self.x + self.width / 2, self.y + self.height / 2

    @property
    def size(self) -> tuple[float, float]:
        """Size (width, height) in pixels."""
        return self.width, self.height

    @property
    def area(self) -> float:
        """Area in square pixels."""
        return self.width * self.height

    def as_tuple(self) -> tuple[float, float, float, float]:
        """Return (x, y, width, height)."""
        return self.x, self.y, self.width, self.height

    def moved_to(self, center: tuple[float, float]) -> BoundingBox:
        """Return the box around another center (x, y)."""
        return BoundingBox.from_center(center, self.size)

    def scaled(self, factor: float) -> BoundingBox:
        """Return the box enlarged by `factor` around its center."""
        return BoundingBox.from_center(self.center, (factor * self.width, factor * self.height))

    def contains(self, point: tuple[float, float]) -> bool:
        """Return whether an image position (x, y) lies in the box or on its edge."""
        return (self.x <= point[0] <= self.x + self.width
                and self.y <= point[1] <= self.y + self.height)

    def intersection(self, other: BoundingBox) -> float:
        """Return the common area with `other` in square pixels."""
        width = min(self.x + self.width, other.x + other.width) - max(self.x, other.x)
        height = min(self.y + self.height, other.y + other.height) - max(self.y, other.y)
        return max(width, 0.0) * max(height, 0.0)

    def overlap(self, other: BoundingBox) -> float:
        """Return intersection over union with `other`, in [0, 1]."""
        common = self.intersection(other)
        return min(1.0, common / (self.area + other.area - common))


def _finite(numbers: Sequence[float]) -> bool:
    """Return whether these are finite numbers, all of them."""
    try:
        return all(map(math.isfinite, numbers))
    except (TypeError, OverflowError):
        return False


class TrackState(Enum):
    """What the tracker believes about its target."""

    TRACKING = 'tracking'
    UNCERTAIN = 'uncertain'
    LOST = 'lost'


@dataclass(frozen=True)
class TrackResult:
    """
    Outcome of one frame.

    Attributes
    ----------
    box : BoundingBox
        Estimated target box; the last trusted one while `state` is LOST.
    score : float
        Probability that `box` covers the target by more than half, in [0, 1].
    state : TrackState
        TRACKING, UNCERTAIN (found, but not learned from) or LOST.
    confidence_map : ndarray, shape (n, n), float32
        Score of the structured correlation filter over `search_region` at the
        winning scale, in units of the target's score in the first frame; cell (i, j)
        covers one n-th of the region in each direction.
    search_region : BoundingBox
        Region of the image that `confidence_map` covers; may exceed the image.
    velocity : tuple of float or None
        Velocity (x, y) of the center, in pixels per second where frames have times, else per
        frame.
    covariance : ndarray, shape (4, 4), or None
        Covariance of center x, center y, width and height of `predicted_box`, in px^2.
    predicted_box : BoundingBox or None
        The target in this frame by its motion and what was measured: close to `box` while the
        target is seen, and where it has gone on to meanwhile, as far as one can tell, when not;
        what the camera does otherwise than before carries it.
    velocity_covariance : ndarray, shape (2, 2), or None
        Covariance of `velocity`, in the square of its unit.
    note : str
        What else a person should know, in a few words: that nothing stood out where the target
        was started, as long as it was not TRACKING since. Empty mostly.

    Notes
    -----
    The four of the motion are None only in results that no tracker has made.

    """

    box: BoundingBox
    score: float
    state: TrackState
    confidence_map: npt.NDArray[np.float32]
    search_region: BoundingBox
    velocity: tuple[float, float] | None = None
    covariance: npt.NDArray[np.float64] | None = None
    predicted_box: BoundingBox | None = None
    velocity_covariance: npt.NDArray[np.float64] | None = None
    note: str = ''
