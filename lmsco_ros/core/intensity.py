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

"""From sensor counts to a working range that does not flicker."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.errors import ImageError

__all__ = ['AutomaticGain', 'IntensityRange', 'check_image', 'to_gray']

_PROBE_POINTS = 8192
_SMALLEST_SIDE = 8


@dataclass(frozen=True)
class IntensityRange:
    """
    Counts that become 0 and 1.

    Attributes
    ----------
    low, high : float
        Counts; high > low.

    """

    low: float
    high: float

    def normalize(self, counts: np.ndarray) -> np.ndarray:
        """Return float32 counts in the working range, not clipped."""
        scale = np.float32(1 / (self.high - self.low))
        return (counts - np.float32(self.low)) * scale


def check_image(image: np.ndarray) -> None:
    """
    Raise ImageError unless the tracker can work in the image.

    Parameters
    ----------
    image : ndarray, shape (H, W) uint8, uint16 or float32, or (H, W, 3) uint8
        Anything else is refused.

    """
    if not isinstance(image, np.ndarray):
        raise ImageError(f'the image is a {type(image).__name__}; expected a NumPy array')
    gray = image.ndim == 2 and image.dtype in (np.uint8, np.uint16, np.float32)
    color = image.ndim == 3 and image.shape[2] == 3 and image.dtype == np.uint8
    if not gray and not color:
        raise ImageError(f'the image has shape {image.shape} and type {image.dtype}; expected '
                         '(H, W) of uint8, uint16 or float32, or (H, W, 3) of uint8')
    if min(image.shape[:2]) < _SMALLEST_SIDE:
        raise ImageError(f'the image has {image.shape[1]} x {image.shape[0]} pixels; '
                         f'expected at least {_SMALLEST_SIDE} in each direction')


def to_gray(pixels: np.ndarray) -> np.ndarray:
    """Return one channel; gray pixels pass through."""
    return pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)


class AutomaticGain:
    """
    Follows the percentiles of the frames.

    Small changes are smoothed, so that a warm object at the border does not make the picture
    flicker; a change above `jump`, as a camera's own gain control makes it, is adopted at once.
    Both rules are relative to the range: a constant gain and offset of the camera change
    nothing.

    Parameters
    ----------
    config : IntensityConfig
        Percentiles and rates.

    """

    def __init__(self, config: IntensityConfig) -> None:
        self._config = config
        self._range: IntensityRange | None = None

    def observe(self, image: np.ndarray) -> IntensityRange:
        """Return the range for this frame, seen on a regular subset of its pixels."""
        measured = self._measure(image)
        if self._range is None or self._jumped(measured):
            self._range = measured
        else:
            rate = self._config.smoothing
            self._range = IntensityRange(
                self._range.low + rate * (measured.low - self._range.low),
                self._range.high + rate * (measured.high - self._range.high))
        return self._range

    def _measure(self, image: np.ndarray) -> IntensityRange:
        """Return the percentiles of a frame."""
        step = max(1, int((image.shape[0] * image.shape[1] / _PROBE_POINTS)**0.5))
        probe = to_gray(np.ascontiguousarray(image[step // 2::step, step // 2::step]))
        finite = probe[np.isfinite(probe)] if probe.dtype == np.float32 else probe
        if finite.size == 0:
            raise ImageError('the image has no finite pixel; expected counts or temperatures')
        low, high = np.percentile(
            finite, (self._config.low_percentile, self._config.high_percentile))
        if high <= low:
            low, high = float(finite.min()), float(finite.max())
        return IntensityRange(float(low), float(high) if high > low else float(low) + 1.0)

    def _jumped(self, measured: IntensityRange) -> bool:
        """Return whether the range has changed by more than a smooth scene explains."""
        assert self._range is not None
        change = max(abs(measured.low - self._range.low), abs(measured.high - self._range.high))
        return change > self._config.jump * (self._range.high - self._range.low)
