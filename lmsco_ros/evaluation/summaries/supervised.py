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

"""Accuracy, robustness and expected overlap over the sequences of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array, has_jumped
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, mean_estimate, ratio_estimate
from lmsco_ros.evaluation.protocols.expected_overlap import longest_fragment, VOT_TIR2016_INTERVAL
from lmsco_ros.evaluation.protocols.ranking import mean_ranks
from lmsco_ros.evaluation.protocols.supervised import accuracy, Fragment, fragments, reliability
from lmsco_ros.evaluation.run_file import EvaluationRun
from lmsco_ros.evaluation.summaries.expected_overlap import curve_and_eao


@dataclass(frozen=True, eq=False)
class SupervisedSummary:
    """
    One tracker in a supervised run.

    Attributes
    ----------
    tracker : str
        Name.
    accuracies, failures : ndarray, shape (sequences,)
        Accuracy and number of failures of each sequence.
    at_jumps : int
        Failures in frames in which the target jumps, as after a cut.
    accuracy : Estimate
        Mean over sequences weighted by their length, as in the VOT toolkit.
    failures_per_sequence, failures_per_100_frames : Estimate
        Plain mean, and all failures over all frames.
    reliability : Estimate
        Chance to survive 30 frames.
    accuracy_rank, robustness_rank : float
        Mean rank over sequences among the trackers of the run.
    curve : ndarray, shape (length of the longest sequence,)
        Expected overlap (MATLAB convention).
    eao, eao_python : Estimate
        Its mean over the interval in the MATLAB and in the Python convention.
    crashes : tuple of str
        `sequence: what happened`.

    """

    tracker: str
    accuracies: Array
    failures: Array
    at_jumps: int
    accuracy: Estimate
    failures_per_sequence: Estimate
    failures_per_100_frames: Estimate
    reliability: Estimate
    accuracy_rank: float
    robustness_rank: float
    curve: Array
    eao: Estimate
    eao_python: Estimate
    crashes: tuple[str, ...]


def eao_interval(run: EvaluationRun) -> tuple[int, int]:
    """
    Return the interval of sequence lengths that EAO is taken over.

    That of VOT-TIR2016, cut to the longest sequence of the run.
    """
    longest = max((len(sequence.ground_truth) for sequence in run.sequences), default=2)
    low, high = VOT_TIR2016_INTERVAL
    return min(low, longest), min(high, longest)


def summarize_supervised(run: EvaluationRun) -> tuple[SupervisedSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    figures = {name: _per_sequence(run, name) for name in run.trackers}
    accuracies = np.array([accuracy_values for accuracy_values, _, _ in figures.values()])
    failures = np.array([failure_counts for _, failure_counts, _ in figures.values()])
    accuracy_ranks = mean_ranks(accuracies, higher_is_better=True)
    robustness_ranks = mean_ranks(failures, higher_is_better=False)
    return tuple(
        _summarize(run, name, figures[name], (accuracy_ranks[index], robustness_ranks[index]))
        for index, name in enumerate(run.trackers))


def _per_sequence(run: EvaluationRun, name: str) -> tuple[Array, Array, list[list[Fragment]]]:
    accuracies, parts = [], []
    for sequence, trace in zip(run.sequences, run.traces[name]):
        overlap = sequence.overlaps(trace, in_image=True)
        accuracies.append(accuracy(overlap, trace.starts, trace.failures))
        parts.append(fragments(overlap, trace.starts, trace.failures))
    failures = np.array([float(len(trace.failures)) for trace in run.traces[name]])
    return np.array(accuracies), failures, parts


def _summarize(run: EvaluationRun, name: str,
               figures: tuple[Array, Array, list[list[Fragment]]],
               ranks: tuple[float, float]) -> SupervisedSummary:
    accuracies, failures, parts = figures
    lengths = np.array([float(len(sequence.ground_truth)) for sequence in run.sequences])
    rate = ratio_estimate(failures, lengths)
    curve, eao = curve_and_eao(parts, int(lengths.max()), eao_interval(run))
    ours = longest_fragment([fragment for part in parts for fragment in part])
    return SupervisedSummary(
        tracker=name, accuracies=accuracies, failures=failures,
        at_jumps=_failures_at_jumps(run, name),
        accuracy=ratio_estimate(accuracies * lengths, lengths),
        failures_per_sequence=mean_estimate(failures),
        failures_per_100_frames=Estimate(100 * rate.value, 100 * rate.low, 100 * rate.high),
        reliability=Estimate(*(reliability(failed, 1.0)
                               for failed in (rate.value, rate.high, rate.low))),
        accuracy_rank=float(ranks[0]), robustness_rank=float(ranks[1]),
        curve=curve, eao=eao,
        eao_python=curve_and_eao(parts, ours, eao_interval(run))[1],
        crashes=run.crashes(name))


def _failures_at_jumps(run: EvaluationRun, name: str) -> int:
    return sum(int(has_jumped(sequence.ground_truth)[list(trace.failures)].sum())
               for sequence, trace in zip(run.sequences, run.traces[name]))
