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

"""Images as OpenCV's trackers want them: 8 bit and three channels."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt


STRETCHING = ('images of more than 8 bits are stretched to 8 bits: black is the 1st, white the '
              '99th percentile of the image of each start')


class EightBitView:
    """
    Map images of any depth to 8-bit BGR with the contrast of the first image.

    The mapping is fixed at the start, since a gain that follows the scene would make
    the target flicker. 8-bit images pass unchanged; pixels without a finite value are black,
    or white where they are infinitely warm.

    Parameters
    ----------
    first : ndarray
        Image that sets black (1st percentile) and white (99th percentile).

    """

    def __init__(self, first: npt.NDArray) -> None:
        """Find the gain."""
        low, high = (0.0, 255.0) if first.dtype == np.uint8 else np.percentile(
            first[np.isfinite(first)], (1, 99))
        self._gain = 255.0 / max(float(high - low), 1e-6)
        self._offset = -float(low) * self._gain

    def __call__(self, image: npt.NDArray) -> npt.NDArray[np.uint8]:
        """Return the view, shape (H, W, 3)."""
        if image.dtype != np.uint8:
            scaled = image.astype(np.float32) * self._gain + self._offset
            image = np.clip(np.nan_to_num(scaled), 0, 255).astype(np.uint8)
        return np.asarray(
            cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image, np.uint8)
