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

"""Means of the one-pass figures over the sequences of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, mean_estimate, ratio_estimate
from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures
from lmsco_ros.evaluation.run_file import EvaluationRun


@dataclass(frozen=True, eq=False)
class OnePassSummary:
    """
    One tracker in a one-pass run.

    Attributes
    ----------
    tracker : str
        Name.
    aucs : ndarray, shape (sequences,)
        Success AUC of each sequence.
    success, precision, normalized : ndarray
        Curves, mean over sequences, at the thresholds of `protocols.one_pass`.
    success_auc, precision_5, precision_20, normalized_auc : Estimate
        Means over sequences.
    cpu_rate, wall_rate : Estimate
        Updates per second of process time and of clock time, over all sequences.
    crashes : tuple of str
        `sequence: what happened`.

    """

    tracker: str
    aucs: Array
    success: Array
    precision: Array
    normalized: Array
    success_auc: Estimate
    precision_5: Estimate
    precision_20: Estimate
    normalized_auc: Estimate
    cpu_rate: Estimate
    wall_rate: Estimate
    crashes: tuple[str, ...]


def summarize_one_pass(run: EvaluationRun) -> tuple[OnePassSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    return tuple(_summarize(run, name) for name in run.trackers)


def _summarize(run: EvaluationRun, name: str) -> OnePassSummary:
    traces = run.traces[name]
    figures = [one_pass_figures(sequence.ground_truth, trace.boxes)
               for sequence, trace in zip(run.sequences, traces)]
    aucs = np.array([item.success_auc for item in figures])
    updates = np.array([float(trace.updates) for trace in traces])
    return OnePassSummary(
        tracker=name, aucs=aucs,
        success=_mean([item.success for item in figures]),
        precision=_mean([item.precision for item in figures]),
        normalized=_mean([item.normalized_precision for item in figures]),
        success_auc=mean_estimate(aucs),
        precision_5=mean_estimate(np.array([item.precision_at(5) for item in figures])),
        precision_20=mean_estimate(np.array([item.precision_at(20) for item in figures])),
        normalized_auc=mean_estimate(
            np.array([item.normalized_precision_auc for item in figures])),
        cpu_rate=ratio_estimate(updates, np.array([trace.cpu_seconds for trace in traces])),
        wall_rate=ratio_estimate(updates, np.array([trace.wall_seconds for trace in traces])),
        crashes=run.crashes(name))


def _mean(curves: list[Array]) -> Array:
    """Return the mean of the curves that are known; NaN where none is."""
    known = [curve for curve in curves if np.isfinite(curve).all()]
    return np.mean(known or curves, axis=0)
