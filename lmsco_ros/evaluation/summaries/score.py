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

"""What each tracker's score is worth, over a one-pass run."""

from __future__ import annotations

from dataclasses import dataclass
import math

from lmsco_ros.evaluation.protocols.bootstrap import Estimate, estimate
from lmsco_ros.evaluation.protocols.calibration import (
    calibration_error, calibration_terms, CalibrationTerms)
from lmsco_ros.evaluation.protocols.confidence import auroc, auroc_terms, mean_auroc
from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures
from lmsco_ros.evaluation.run_file import EvaluationRun

_NEAR_PIXELS = 5


@dataclass(frozen=True, eq=False)
class ScoreSummary:
    """
    One tracker's score in a one-pass run; all is NaN without scores.

    Attributes
    ----------
    tracker : str
        Name.
    auroc : Estimate
        Chance that a frame with overlap above 0.5 has a higher score than one without, over the
        frames of all sequences with a target.
    mean_auroc : Estimate
        Mean of that of each sequence that has frames of both kinds.
    calibration_error : Estimate
        Expected calibration error of the score as the probability of such a frame, over all
        frames, also those without a target.
    calibration : CalibrationTerms
        What it is made of.

    """

    tracker: str
    auroc: Estimate
    mean_auroc: Estimate
    calibration_error: Estimate
    calibration: CalibrationTerms


def summarize_scores(run: EvaluationRun) -> tuple[ScoreSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    return tuple(_summarize(run, name) for name in run.trackers)


def size_note(run: EvaluationRun) -> str:
    """Return of which trackers the AUROC says nothing of losses; empty where of none."""
    names = [name for name in run.trackers if _stays_near(run, name)]
    if not names:
        return ''
    return (f'All frames of {", ".join(names)} are within {_NEAR_PIXELS} pixels of the target: '
            'what has less than half an overlap there has another size, so AUROC compares sizes '
            'and says nothing of losses.')


def _stays_near(run: EvaluationRun, name: str) -> bool:
    """Return whether a tracker was near the target in every frame that shows one."""
    shares = [one_pass_figures(sequence.ground_truth, trace.boxes).precision_at(_NEAR_PIXELS)
              for sequence, trace in zip(run.sequences, run.traces[name], strict=True)]
    known = [share for share in shares if math.isfinite(share)]
    return bool(known) and min(known) == 1


def _summarize(run: EvaluationRun, name: str) -> ScoreSummary:
    traces = run.traces[name]
    scores = [trace.scores for trace in traces]
    overlaps = [sequence.overlaps(trace, in_image=False)
                for sequence, trace in zip(run.sequences, traces)]
    pairs, calibration = auroc_terms(scores, overlaps), calibration_terms(scores, overlaps)
    return ScoreSummary(
        tracker=name,
        auroc=estimate(lambda weights: auroc(*pairs, weights), len(traces)),
        mean_auroc=estimate(lambda weights: mean_auroc(*pairs, weights), len(traces)),
        calibration_error=estimate(lambda weights: calibration_error(calibration, weights),
                                   len(traces)),
        calibration=calibration)
