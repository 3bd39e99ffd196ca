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
Measures of single benchmarks over a one-pass run, each as its own toolkit takes it.

- GOT-10k: L. Huang, X. Zhao, K. Huang, IEEE TPAMI 43, 2021: average overlap and success rates over
  the frames of all sequences, without the first ones, of what lies in the image.
- LaSOT: H. Fan et al., CVPR 2019: precision at 0.2 of the target's size.
- Anti-UAV: N. Jiang et al., IEEE TMM 25, 2023: overlap where the target is there, and 1 where it
  is rightly said not to be.
- RGB-T: C. Li et al., "RGB-T object tracking: benchmark and baseline", Pattern Recognition 96,
  2019: success and precision by the boxes of that channel that a tracker is nearer to.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from lmsco_ros.evaluation.geometry import Array, center_offsets, is_absent, overlaps
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, mean_estimate, ratio_estimate
from lmsco_ros.evaluation.protocols.one_pass import (
    NORMALIZED_THRESHOLDS, one_pass_figures, SUCCESS_THRESHOLDS)
from lmsco_ros.evaluation.run_file import EvaluationRun, SequenceInfo
from lmsco_ros.evaluation.trace import Trace

_PRECISION_PIXELS = 20
_LASOT_THRESHOLD = int(np.flatnonzero(np.isclose(NORMALIZED_THRESHOLDS, 0.2))[0])


@dataclass(frozen=True)
class BenchmarkSummary:
    """
    One tracker by the measures of several benchmarks.

    Attributes
    ----------
    tracker : str
        Name.
    average_overlap, success_50, success_75 : Estimate
        Mean overlap, and the shares of frames in which it is above 0.5 and 0.75 (GOT-10k).
    normalized_precision_20 : Estimate
        Share of frames with a center error of at most 0.2 target sizes (LaSOT), mean over
        sequences.
    state_accuracy : Estimate
        Mean over sequences (Anti-UAV).
    maximum_success, maximum_precision : Estimate
        Success AUC, and the share of frames with a center error of at most 20 px, by the nearer
        of two channels (RGBT234); over the sequences that have two, else NaN.

    """

    tracker: str
    average_overlap: Estimate
    success_50: Estimate
    success_75: Estimate
    normalized_precision_20: Estimate
    state_accuracy: Estimate
    maximum_success: Estimate
    maximum_precision: Estimate


def summarize_benchmarks(run: EvaluationRun) -> tuple[BenchmarkSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    return tuple(_summarize(run, name) for name in run.trackers)


def state_accuracy(overlap: Array, trace: Trace) -> float:
    """
    Return the state accuracy of one sequence.

    Parameters
    ----------
    overlap : ndarray, shape (n,)
        Overlap for each frame, NaN where the target is absent.
    trace : Trace
        Answers; a tracker says that the target is absent by LOST or by no box.

    """
    said = trace.lost | is_absent(trace.boxes)
    return float(np.where(np.isnan(overlap), said, np.nan_to_num(overlap) * ~said).mean())


def nearer_figures(sequence: SequenceInfo, trace: Trace) -> tuple[float, float]:
    """Return success AUC and precision at 20 px by the nearer of two channels; NaN without."""
    if sequence.other_truth is None:
        return math.nan, math.nan
    truths = sequence.ground_truth, sequence.other_truth
    overlap = np.fmax(*(overlaps(truth, trace.boxes) for truth in truths))
    errors = np.fmin(*(np.linalg.norm(center_offsets(truth, trace.boxes), axis=1)
                       for truth in truths))
    known = np.isfinite(overlap)
    if not known.any():
        return math.nan, math.nan
    success = (overlap[known, None] > SUCCESS_THRESHOLDS).mean()
    return float(success), float((errors[known] <= _PRECISION_PIXELS).mean())


def _summarize(run: EvaluationRun, name: str) -> BenchmarkSummary:
    pairs = list(zip(run.sequences, run.traces[name], strict=True))
    followed = [sequence.overlaps(trace, in_image=True)[1:] for sequence, trace in pairs]
    known = [overlap[np.isfinite(overlap)] for overlap in followed]
    frames = np.array([float(len(overlap)) for overlap in known])
    normalized = [one_pass_figures(sequence.ground_truth, trace.boxes).normalized_precision
                  for sequence, trace in pairs]
    nearer = np.array([nearer_figures(sequence, trace) for sequence, trace in pairs])
    return BenchmarkSummary(
        tracker=name,
        average_overlap=ratio_estimate(np.array([overlap.sum() for overlap in known]), frames),
        success_50=_above(known, 0.5, frames), success_75=_above(known, 0.75, frames),
        normalized_precision_20=mean_estimate(
            np.array([curve[_LASOT_THRESHOLD] for curve in normalized])),
        state_accuracy=mean_estimate(np.array([
            state_accuracy(sequence.overlaps(trace, in_image=False), trace)
            for sequence, trace in pairs])),
        maximum_success=mean_estimate(nearer[:, 0]),
        maximum_precision=mean_estimate(nearer[:, 1]))


def _above(found: list[Array], threshold: float, frames: Array) -> Estimate:
    """Return the share of frames with an overlap above a threshold."""
    return ratio_estimate(
        np.array([float((overlap > threshold).sum()) for overlap in found]), frames)
