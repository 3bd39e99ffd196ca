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

"""From sensor counts to an 8-bit view that does not flicker."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.imaging.pixels import measured

_PERCENTILES = (0.5, 99.5)
# Share of the span left free below and above, so that a small hot target outside
# the percentiles is still told apart from its surroundings.
_HEADROOM = 0.1
_SAMPLES = 20000


class DisplayRange:
    """
    Contrast stretch by robust percentiles that follows a stream slowly.

    Percentiles of single frames jump as warm things enter and leave; a stretch that
    follows them at once flickers. This one moves a fraction of the way each frame, and
    jumps only when the old range shows nothing of the new image (a shutter event, a
    switch of gain).

    Parameters
    ----------
    rate : float
        Fraction of the way to the new frame's percentiles, in (0, 1]; 1 does not smooth.

    """

    def __init__(self, rate: float = 0.1) -> None:
        if not 0 < rate <= 1:
            raise ValueError(f'rate is {rate}; give a fraction in (0, 1]')
        self._rate = rate
        self._low: float | None = None
        self._high: float | None = None

    def apply(self, image: npt.NDArray) -> npt.NDArray[np.uint8]:
        """
        Return the 8-bit view of the next frame.

        Parameters
        ----------
        image : ndarray, shape (H, W) of any real type or (H, W, 3) uint8
            8-bit images are returned as they are.

        Returns
        -------
        ndarray, shape (H, W) or (H, W, 3), uint8

        Raises
        ------
        ImageError
            When the image is empty or has another shape or type.

        """
        if image.size and image.dtype == np.uint8 and (
                image.ndim == 2 or image.ndim == 3 and image.shape[2] == 3):
            return image
        if image.ndim != 2 or not image.size or image.dtype.kind not in 'uif':
            raise ImageError(
                f'cannot display an image of shape {image.shape} and type {image.dtype}; '
                'give (H, W) numbers or (H, W, 3) uint8')
        image = measured(image)
        low, high = self._follow(image)
        view = (image.astype(np.float32) - np.float32(low)) * np.float32(255 / (high - low))
        return np.nan_to_num(np.clip(view, 0, 255), copy=False).astype(np.uint8)

    def _follow(self, image: npt.NDArray) -> tuple[float, float]:
        """Move the range towards that of `image` and return it."""
        low, high = _robust_range(image)
        if self._low is not None and self._high is not None \
                and low < self._high and self._low < high:
            low = self._low + self._rate * (low - self._low)
            high = self._high + self._rate * (high - self._high)
        self._low, self._high = low, high
        return low, high


def _robust_range(image: npt.NDArray) -> tuple[float, float]:
    """Return the counts shown as black and as white, from a sparse grid of pixels."""
    step = max(1, int((image.size / _SAMPLES) ** 0.5))
    samples = image[::step, ::step].astype(np.float64)
    samples = samples[np.isfinite(samples)]
    if not samples.size:
        return 0.0, 1.0
    low, high = np.percentile(samples, _PERCENTILES)
    margin = max(_HEADROOM * (high - low), 1e-6 * max(abs(low), abs(high), 1.0))
    return float(low - margin), float(high + margin)
