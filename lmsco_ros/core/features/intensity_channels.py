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

"""Intensity channels: what gradients do not say, the temperature itself."""

from __future__ import annotations

import cv2
import numpy as np

from lmsco_ros.core.imaging.sampled import percentiles

__all__ = ['intensity_channels']


def intensity_channels(patch: np.ndarray, cell: int) -> np.ndarray:
    """
    Return the mean intensity of each cell, against the patch and against its neighborhood.

    Parameters
    ----------
    patch : ndarray, shape (size, size), float32
        Intensities; size is a multiple of `cell`.
    cell : int
        Side of a cell in pixels.

    Returns
    -------
    ndarray, shape (N, N, 2), float32
        Cell mean minus the median cell of the patch, and minus the mean of the 9 x 9 cells
        around it.

    """
    cells = patch.shape[0] // cell
    means = cv2.resize(patch, (cells, cells), interpolation=cv2.INTER_AREA)
    local = cv2.blur(means, (9, 9), borderType=cv2.BORDER_REPLICATE)
    return np.stack([means - percentiles(means, (50.0,))[0], means - local], axis=-1)
