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
Accuracy, robustness, expected overlap and success over the starts of a run.

Robustness is that of each sequence weighted by its length, accuracy the mean over all
frames that were survived, and the expected-overlap curve the mean over all parts that tell
something about a length, as in VOT2020 (see `protocols.anchors`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.anchors import (
    part_outcome, PartOutcome, touches_border, VOT2020_INTERVAL)
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, ratio_estimate
from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures
from lmsco_ros.evaluation.run_file import EvaluationRun
from lmsco_ros.evaluation.summaries.expected_overlap import curve_and_eao


@dataclass(frozen=True, eq=False)
class StartFigures:
    """
    Figures over a group of starts; NaN without any.

    Attributes
    ----------
    starts, failures : int
        Number of starts, and how many of them ended in a failure.
    success_auc : Estimate
        Mean over the starts of the success AUC of their parts.
    accuracy : Estimate
        Mean overlap before the failures.
    robustness : Estimate
        Share of the frames before the failures.

    """

    starts: int
    failures: int
    success_auc: Estimate
    accuracy: Estimate
    robustness: Estimate


@dataclass(frozen=True, eq=False)
class AnchorSummary:
    """
    One tracker in a run with several starts a sequence.

    Attributes
    ----------
    tracker : str
        Name.
    aucs : ndarray, shape (parts,)
        Success AUC of each part.
    all_starts, entering, in_view : StartFigures
        Figures over all starts, over those whose box touches the border of the image, and
        over the others.
    curve : ndarray, shape (length of the longest part,)
        Expected overlap.
    eao : Estimate
        Its mean over `anchor_interval`.
    crashes : tuple of str
        `sequence: what happened`.

    """

    tracker: str
    aucs: Array
    all_starts: StartFigures
    entering: StartFigures
    in_view: StartFigures
    curve: Array
    eao: Estimate
    crashes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Parts:
    """
    All parts of a run for one tracker.

    Attributes
    ----------
    wholes : ndarray, shape (parts,), int
        For each part which whole sequence it belongs to.
    lengths : ndarray, shape (sequences,)
        Frames of the whole sequences.
    outcomes : tuple of PartOutcome
        How each part went.
    aucs : ndarray, shape (parts,)
        Success AUC of each part.

    """

    wholes: npt.NDArray[np.intp]
    lengths: Array
    outcomes: tuple[PartOutcome, ...]
    aucs: Array

    def totals(self, values: npt.ArrayLike) -> Array:
        """Return the sum of one value a part over the parts of each whole sequence."""
        sums = np.bincount(self.wholes, np.asarray(values, dtype=float), len(self.lengths))
        return sums.astype(float)


def anchor_interval(run: EvaluationRun) -> tuple[int, int]:
    """Return the lengths that EAO is taken over: those of VOT2020, cut to the longest part."""
    low, high = VOT2020_INTERVAL
    return min(low, _longest(run)), min(high, _longest(run))


def summarize_anchors(run: EvaluationRun) -> tuple[AnchorSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    return tuple(_summarize(run, name) for name in run.trackers)


def _longest(run: EvaluationRun) -> int:
    return max(len(sequence.ground_truth) for sequence in run.sequences)


def _summarize(run: EvaluationRun, name: str) -> AnchorSummary:
    parts = _parts(run, name)
    entering = np.array([bool(touches_border(sequence.ground_truth[:1], sequence.size)[0])
                         for sequence in run.sequences])
    fragments = [[outcome.fragment for outcome, place in zip(parts.outcomes, parts.wholes)
                  if place == whole] for whole in range(len(parts.lengths))]
    curve, eao = curve_and_eao(fragments, _longest(run), anchor_interval(run))
    return AnchorSummary(
        tracker=name, aucs=parts.aucs,
        all_starts=_figures(parts, np.ones(len(entering), dtype=bool)),
        entering=_figures(parts, entering), in_view=_figures(parts, ~entering),
        curve=curve, eao=eao, crashes=run.crashes(name))


def _parts(run: EvaluationRun, name: str) -> _Parts:
    pairs = list(zip(run.sequences, run.traces[name]))
    return _Parts(
        wholes=np.array([run.wholes.index(sequence.whole) for sequence in run.sequences]),
        lengths=np.array([float(whole.frames) for whole in run.wholes]),
        outcomes=tuple(part_outcome(sequence.overlaps(trace, in_image=True))
                       for sequence, trace in pairs),
        aucs=np.array([one_pass_figures(sequence.ground_truth, trace.boxes).success_auc
                       for sequence, trace in pairs]))


def _figures(parts: _Parts, chosen: npt.NDArray[np.bool_]) -> StartFigures:
    """Return the figures over the chosen parts; intervals are over whole sequences."""
    outcomes = parts.outcomes
    frames = parts.totals(chosen * np.array([item.frames for item in outcomes]))
    survived = parts.totals(chosen * np.array([item.survived for item in outcomes]))
    weights = np.where(frames > 0, parts.lengths, 0)
    return StartFigures(
        starts=int(chosen.sum()),
        failures=sum(item.fragment.failed for item, taken in zip(outcomes, chosen) if taken),
        success_auc=ratio_estimate(parts.totals(chosen * parts.aucs), parts.totals(chosen)),
        accuracy=ratio_estimate(
            parts.totals(chosen * np.array([item.measured.sum() for item in outcomes])),
            parts.totals(chosen * np.array([len(item.measured) for item in outcomes]))),
        robustness=ratio_estimate(weights * survived / np.maximum(frames, 1), weights))
