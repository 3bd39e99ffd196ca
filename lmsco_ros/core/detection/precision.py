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

"""How exactly a detection says where the target is: the curvature of its peak, other peaks."""

from __future__ import annotations

from collections.abc import Callable
import math

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.backend import to_numpy
from lmsco_ros.core.detection.detector import Detection
from lmsco_ros.core.fourier.localization import curvature
from lmsco_ros.core.types import BoundingBox

__all__ = ['box_covariance', 'center_covariance']

# Of the errors in the score at neighboring shifts, which are not alike as the theory has it.
_INFLATION = 2.5
# In periods: a peak so flat says nothing but that the target is in the search region.
_LARGEST_DEVIATION = 0.25
# Deviation of a measured size from one frame to the next, as a part of it.
_SIZE_ERROR = 0.02


def box_covariance(detection: Detection, box: BoundingBox) -> npt.NDArray[np.float64]:
    """Return the covariance of center x, center y, width and height of a measured box, in px^2."""
    covariance = np.diag([0.0, 0.0, *((_SIZE_ERROR * side)**2 for side in box.size)])
    covariance[:2, :2] = center_covariance(detection, math.sqrt(box.area))
    return covariance


def center_covariance(detection: Detection, side: float) -> npt.NDArray[np.float64]:
    """
    Return the covariance of the center of a detection, (x, y) in px^2, shape (2, 2).

    Parameters
    ----------
    detection : Detection
        What the filter saw.
    side : float
        Of the target, in pixels; peaks that are nearer than half of it are one.

    Notes
    -----
    Where a score s with the Hessian -H has an error of deviation e that is as smooth as the
    score itself, its maximum is off by the covariance (e / s)^2 (H / s)^-1: the width of the peak
    over its peak-to-sidelobe ratio s / e. That the peak belongs to something else has the
    probability Phi(-(s - s2) / (sqrt(2) e)) of another one that is s2 high: that errors have
    changed the order of two equals. Its distance d adds this part of d d^T.

    """
    sizes = np.array([detection.region.width, detection.region.height])
    ratio = max(detection.sharpness, 1e-6)
    precision = -curvature(to_numpy(detection.scores), detection.peak.displacement)[::-1, ::-1]
    covariance = _of_eigenvalues(
        precision / max(detection.peak.value, 1e-12), lambda value: min(
            _INFLATION / (ratio * math.sqrt(max(value, 1e-12))), _LARGEST_DEVIATION)**2)
    way, chance = _other_peak(detection, side)
    return (covariance + chance * np.outer(way, way)) * np.outer(sizes, sizes)


def _of_eigenvalues(matrix: npt.NDArray[np.float64],
                    function: Callable[[float], float]) -> npt.NDArray[np.float64]:
    """Return the symmetric matrix (2, 2) with the same axes and a function of the eigenvalues."""
    (xx, xy), (_, yy) = matrix.tolist()
    middle, radius = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    low, high = function(middle - radius), function(middle + radius)
    slope = (high - low) / (2 * radius) if radius > 0 else 0.0
    return (low + high) / 2 * np.eye(2) + slope * (matrix - middle * np.eye(2))


def _other_peak(detection: Detection,
                side: float) -> tuple[npt.NDArray[np.float64], float]:
    """Return the way (x, y) in periods to the highest other peak, and the chance that it is it."""
    grid, size = detection.peak.grid, detection.peak.grid.shape[0]
    middle = [round(t * size) for t in detection.peak.displacement]
    reach = min(round(size * side / (2 * detection.region.width)), (size - 2) // 2)
    around = np.arange(-reach, reach + 1)
    own = ((middle[0] + around) % size)[:, None], (middle[1] + around) % size
    others = grid.astype(np.float64)
    mean = (others.sum() - others[own].sum()) / (others.size - around.size**2)
    others[own] = -np.inf
    row, column = divmod(int(others.argmax()), size)
    way = (np.array([column - middle[1], row - middle[0]]) / size + 0.5) % 1.0 - 0.5
    error = (detection.peak.value - mean) / max(detection.sharpness, 1e-6)
    lead = (detection.peak.value - float(others[row, column])) / max(error, 1e-12)
    return way, 0.5 * math.erfc(lead / 2)
