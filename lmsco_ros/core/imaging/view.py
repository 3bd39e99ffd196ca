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

"""A view of a frame: its pixels in the working range, converted only where sampled."""

from __future__ import annotations

from dataclasses import dataclass
import math

import cv2
import numpy as np

from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.pixels import measured, to_gray, without_dead_pixels
from lmsco_ros.core.types import BoundingBox

__all__ = ['FrameView']


@dataclass(frozen=True)
class FrameView:
    """
    One frame and the range its counts are seen in; pixels are converted only where sampled.

    Attributes
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        The frame, not copied.
    intensity : IntensityRange
        Working range.

    """

    image: np.ndarray
    intensity: IntensityRange

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.image.shape[1], self.image.shape[0]

    def copied(self) -> FrameView:
        """Return a view that does not change when the caller's image does."""
        return FrameView(self.image.copy(), self.intensity)

    def patch(self, region: BoundingBox, size: tuple[int, int]) -> np.ndarray:
        """
        Resample a region of the frame.

        Parameters
        ----------
        region : BoundingBox
            In image pixels; the border pixels are repeated outside of the image.
        size : tuple of int
            Width and height of the patch.

        Returns
        -------
        ndarray, shape (height, width), float32
            Intensities in the working range. A region with more pixels than the patch is
            averaged, not skipped through. Dead pixels are filled in first.

        """
        step = (region.width / size[0], region.height / size[1])
        factor = (max(1, int(step[0])), max(1, int(step[1])))
        x0, x1 = _covering_span(region.x, region.width, self.size[0], factor[0])
        y0, y1 = _covering_span(region.y, region.height, self.size[1], factor[1])
        pixels = without_dead_pixels(measured(to_gray(self.image[y0:y1, x0:x1])),
                                     abs(self.intensity.high - self.intensity.low))
        if factor != (1, 1):
            pixels = _average(pixels, factor)
        values = self.intensity.normalize(pixels.astype(np.float32, copy=False))
        if self.image.dtype == np.float32:
            values = np.nan_to_num(values, copy=False)
        start = ((region.x + step[0] / 2 - x0) / factor[0] - 0.5,
                 (region.y + step[1] / 2 - y0) / factor[1] - 0.5)
        inverse = np.array([[step[0] / factor[0], 0, start[0]],
                            [0, step[1] / factor[1], start[1]]])
        return cv2.warpAffine(values, inverse, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                              borderMode=cv2.BORDER_REPLICATE)


def _covering_span(start: float, length: float, limit: int, factor: int) -> tuple[int, int]:
    """Return the pixel span inside the image that a resampled interval reads from."""
    margin = 2 * factor
    first = min(max(math.floor(start) - margin, 0), limit - 1)
    last = min(max(math.ceil(start + length) + margin, first + 1), limit)
    return first, last


def _average(pixels: np.ndarray, factor: tuple[int, int]) -> np.ndarray:
    """Return the means over cells of `factor` pixels; incomplete cells count as they are."""
    height, width = pixels.shape
    pad = (-height % factor[1], -width % factor[0])
    if any(pad):
        pixels = cv2.copyMakeBorder(pixels, 0, pad[0], 0, pad[1], cv2.BORDER_REPLICATE)
    size = (pixels.shape[1] // factor[0], pixels.shape[0] // factor[1])
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
