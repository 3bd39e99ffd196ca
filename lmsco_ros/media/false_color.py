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

"""Gray images that are stored in color."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

# Video codecs leave a color cast of a few levels on footage that was gray.
_GRAY_TOLERANCE = 8


def without_false_color(image: npt.NDArray) -> npt.NDArray:
    """
    Return a gray image for one that is stored in color but shows none.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        Image as decoded.

    Returns
    -------
    ndarray, shape (H, W) or (H, W, 3)
        One channel where the three agree to within a few levels, else the image itself.

    """
    if image.ndim == 2:
        return image
    blue, green, red = cv2.split(image)[:3]
    spread = max(cv2.absdiff(*pair).max() for pair in
                 ((blue, green), (green, red), (blue, red)))
    if spread <= _GRAY_TOLERANCE:
        return green
    return image if image.shape[2] == 3 else np.ascontiguousarray(image[..., :3])
