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

"""Whether errors of the position are as large as the tracker says they are."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from lmsco_ros.evaluation.geometry import Array, center_offsets
from lmsco_ros.evaluation.trace import Trace

LEVEL = 0.95
DIMENSIONS = 2


def normalized_errors(ground_truth: Array, trace: Trace) -> Array:
    """
    Return the squared errors of the center, as multiples of what the covariance says.

    Parameters
    ----------
    ground_truth : ndarray, shape (n, 4)
        True boxes, NaN where absent.
    trace : Trace
        Answers of the tracker.

    Returns
    -------
    ndarray, shape (n,)
        e^T P^-1 e, on average 2 where the covariance P is right; NaN where the target is absent
        or there is no (positive) covariance.

    References
    ----------
    Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001,
    5.4.

    """
    if trace.predicted is None or trace.covariances is None:
        return np.full(len(ground_truth), np.nan)
    x, y = center_offsets(ground_truth, trace.predicted).T
    xx, xy, yy = (trace.covariances[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    determinant = xx * yy - xy**2
    known = np.isfinite(x) & (determinant > 0) & (xx > 0)
    return np.divide(yy * x**2 - 2 * xy * x * y + xx * y**2, determinant,
                     out=np.full(len(x), np.nan), where=known)


def consistency_band(sequences: int) -> tuple[float, float]:
    """
    Return between what the mean over so many sequences lies at the level `LEVEL`.

    Frames of one sequence are far from independent, so each sequence counts as one draw.
    """
    low, high = chi2.ppf([(1 - LEVEL) / 2, (1 + LEVEL) / 2], DIMENSIONS * sequences) / sequences
    return float(low), float(high)


def largest_usual_error() -> float:
    """Return the normalized error squared that a share `LEVEL` of the frames stays below."""
    return float(chi2.ppf(LEVEL, DIMENSIONS))
