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

"""Edges of the image that the tracker does not get to see, such as rows of telemetry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.types import BoundingBox, TrackResult


@dataclass(frozen=True)
class Crop:
    """
    Pixels to cut off at each edge; boxes are moved between the two frames of reference.

    Parameters
    ----------
    left, top, right, bottom : int
        In pixels, not negative.

    """

    left: int = 0
    top: int = 0
    right: int = 0
    bottom: int = 0

    def trim(self, image: npt.NDArray) -> npt.NDArray:
        """
        Return a view of what remains of the image.

        Raises
        ------
        ImageError
            When nothing remains.

        """
        height, width = image.shape[:2]
        remaining = image[self.top:height - min(self.bottom, height),
                          self.left:width - min(self.right, width)]
        if not remaining.size:
            raise ImageError(
                f'nothing remains of an image of {width} x {height} pixels without '
                f'{self.left} at the left, {self.top} at the top, {self.right} at the right and '
                f'{self.bottom} at the bottom; lower crop_left, crop_top, crop_right or '
                'crop_bottom')
        return remaining

    def full_shape(self, remaining: npt.NDArray) -> tuple[int, int]:
        """Return (height, width) of the image that this remained of."""
        height, width = remaining.shape[:2]
        return height + self.top + self.bottom, width + self.left + self.right

    def fill(self, remaining: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Return a picture of the full size, black where it was cut off."""
        if self == Crop():
            return remaining
        picture = cv2.copyMakeBorder(remaining, self.top, self.bottom, self.left, self.right,
                                     cv2.BORDER_CONSTANT)
        return np.asarray(picture, np.uint8)

    def inwards(self, box: BoundingBox) -> BoundingBox:
        """Return a box of the full image, as seen in what remains."""
        return replace(box, x=box.x - self.left, y=box.y - self.top)

    def inwards_point(self, point: tuple[float, float]) -> tuple[float, float]:
        """Return a point (x, y) of the full image, as seen in what remains."""
        return point[0] - self.left, point[1] - self.top

    def outwards(self, result: TrackResult) -> TrackResult:
        """Return a result found in what remains, in pixels of the full image."""
        predicted = result.predicted_box
        return replace(result, box=self._outwards(result.box),
                       search_region=self._outwards(result.search_region),
                       predicted_box=None if predicted is None else self._outwards(predicted))

    def _outwards(self, box: BoundingBox) -> BoundingBox:
        return replace(box, x=box.x + self.left, y=box.y + self.top)
