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

"""How warm the target is: what the sensor counts under its box."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.imaging.pixels import measured
from msg_adapters.status import Reading


def target_reading(image: npt.NDArray, box: Sequence[float]) -> Reading | None:
    """
    Return the lowest, the mean and the highest value under the box.

    Pixels count when their center lies in the box and their value is finite.

    Parameters
    ----------
    image : ndarray, shape (H, W)
        Counts or temperatures. Color, (H, W, 3), has neither.
    box : (x, y, width, height)
        In pixels of the image; may exceed it.

    Returns
    -------
    Reading or None
        In the units of the image; None for color and where no pixel counts.

    """
    if image.ndim != 2:
        return None
    height, width = image.shape
    left, right = _pixels(box[0], box[2], width)
    top, bottom = _pixels(box[1], box[3], height)
    values = measured(image[top:bottom, left:right])
    if values.dtype.kind == 'f':
        values = values[np.isfinite(values)]
    if not values.size:
        return None
    return Reading(float(values.min()), float(values.mean(dtype=np.float64)),
                   float(values.max()))


def celsius(reading: Reading | None, scale: float, offset: float) -> Reading | None:
    """
    Return `value * scale + offset` of each value of the reading.

    Parameters
    ----------
    reading : Reading or None
        In the units of the image.
    scale : float
        Degrees Celsius for one unit; 0 says that the image is not radiometric.
    offset : float
        Degrees Celsius at the value 0.

    Returns
    -------
    Reading or None
        In degrees Celsius; None without a reading or a scale.

    """
    if reading is None or not scale:
        return None
    return Reading(*(value * scale + offset for value in reading))


def _pixels(start: float, length: float, limit: int) -> tuple[int, int]:
    """Return the first pixel with its center in the span, and the one behind the last."""
    first, end = np.clip(np.ceil([start - 0.5, start + length - 0.5]), 0, limit).astype(int)
    return int(first), int(end)
