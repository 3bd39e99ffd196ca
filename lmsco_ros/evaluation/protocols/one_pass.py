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

"""
One-pass evaluation (OPE): start once, never help again.

Success and precision follow Wu, Lim, Yang, "Object Tracking Benchmark" (2015): the
first frame counts, frames without a target do not. Normalized precision follows
Muller et al., "TrackingNet" (2018).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array, center_offsets, overlaps

SUCCESS_THRESHOLDS: Array = np.linspace(0, 1, 21)
PRECISION_THRESHOLDS: Array = np.arange(51, dtype=float)
NORMALIZED_THRESHOLDS: Array = np.linspace(0, 0.5, 51)


@dataclass(frozen=True)
class OnePassFigures:
    """
    Outcome of one tracker on one sequence.

    Attributes
    ----------
    success : ndarray, shape (21,)
        Share of frames with an overlap above each of `SUCCESS_THRESHOLDS`.
    precision : ndarray, shape (51,)
        Share of frames with a center error of at most each of `PRECISION_THRESHOLDS` px.
    normalized_precision : ndarray, shape (51,)
        The same with the error as a share of the true box, at `NORMALIZED_THRESHOLDS`.

    """

    success: Array
    precision: Array
    normalized_precision: Array

    @property
    def success_auc(self) -> float:
        """Mean of the success curve, in [0, 1]."""
        return float(self.success.mean())

    @property
    def normalized_precision_auc(self) -> float:
        """Mean of the normalized precision curve, in [0, 1]."""
        return float(self.normalized_precision.mean())

    def precision_at(self, pixels: int) -> float:
        """Return the share of frames with a center error of at most `pixels`."""
        return float(self.precision[pixels])


def one_pass_figures(ground_truth: Array, boxes: Array) -> OnePassFigures:
    """
    Return success, precision and normalized precision of one sequence.

    Parameters
    ----------
    ground_truth, boxes : ndarray, shape (n, 4)
        True boxes (NaN: target absent, not counted) and answers (NaN: none, a miss). With a
        target in no frame but the one of the start, all figures are NaN.

    """
    overlap = overlaps(ground_truth, boxes)
    counted = np.isfinite(overlap)
    if counted.sum() < 2 <= len(counted):
        return OnePassFigures(*(np.full(len(thresholds), np.nan) for thresholds in (
            SUCCESS_THRESHOLDS, PRECISION_THRESHOLDS, NORMALIZED_THRESHOLDS)))
    offsets = center_offsets(ground_truth, boxes)[counted]
    errors = np.linalg.norm(offsets, axis=1)
    relative = np.linalg.norm(offsets / ground_truth[counted, 2:], axis=1)
    return OnePassFigures(
        success=(overlap[counted, None] > SUCCESS_THRESHOLDS).mean(axis=0),
        precision=(errors[:, None] <= PRECISION_THRESHOLDS).mean(axis=0),
        normalized_precision=(relative[:, None] <= NORMALIZED_THRESHOLDS).mean(axis=0))
