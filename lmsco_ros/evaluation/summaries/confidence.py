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

"""How far each tracker's LOST and its claims can be trusted, over a one-pass run."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

from lmsco_ros.evaluation.protocols.bootstrap import Estimate, ratio_estimate
from lmsco_ros.evaluation.protocols.confidence import (
    lost_figures, return_figures, RETURN_FRAMES)
from lmsco_ros.evaluation.run_file import EvaluationRun


@dataclass(frozen=True)
class ConfidenceSummary:
    """
    One tracker's own word in a one-pass run.

    Attributes
    ----------
    tracker : str
        Name.
    departures, declared, declared_soon : int
        Times a target left, how often LOST followed before it came back, and how often within
        30 frames.
    delay : float
        Median number of frames from leaving to LOST where it was declared, else NaN.
    false_alarms : Estimate
        False declarations of LOST per 1000 frames with a target.
    recovered_share : Estimate
        Share of these after which the target was found again within 30 frames.
    lost_share : Estimate
        Share of the frames with a target that were spent in LOST, justified or not.
    absent : int
        Frames without the target.
    claimed_share : Estimate
        Share of these for which a box was claimed; NaN where the target never left.
    returns, found : int
        Times the target came back, and how often it was found again soon.
    found_share : Estimate
        The second as a share of the first.
    found_delay : float
        Median number of frames that took where it was found, else NaN.
    mistaken : int
        Returns after which a box elsewhere was claimed first.

    """

    tracker: str
    departures: int
    declared: int
    declared_soon: int
    delay: float
    false_alarms: Estimate
    recovered_share: Estimate
    lost_share: Estimate
    absent: int
    claimed_share: Estimate
    returns: int
    found: int
    found_share: Estimate
    found_delay: float
    mistaken: int


def summarize_confidence(run: EvaluationRun) -> tuple[ConfidenceSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    return tuple(_summarize(run, name) for name in run.trackers)


def confidence_parts(run: EvaluationRun) -> list[tuple[str, EvaluationRun]]:
    """Return the parts of a run that are judged apart: one for each challenge, or all as one."""
    return [(name, run.only(challenge=name)) for name in run.challenges] or [('', run)]


def _summarize(run: EvaluationRun, name: str) -> ConfidenceSummary:
    traces = run.traces[name]
    overlaps = [sequence.overlaps(trace, in_image=False)
                for sequence, trace in zip(run.sequences, traces)]
    lost = [lost_figures(trace.lost, overlap) for trace, overlap in zip(traces, overlaps)]
    delays = [delay for figures in lost for delay in figures.delays]
    declared = [delay for delay in delays if delay is not None]
    back = [return_figures(sequence.ground_truth, trace, overlap)
            for sequence, trace, overlap in zip(run.sequences, traces, overlaps)]
    found = [[delay for delay in figures.delays if delay is not None] for figures in back]
    all_found = [delay for delays in found for delay in delays]
    false_alarms = np.array([float(figures.false_alarms) for figures in lost])
    present = np.array([figures.frames_present / 1000 for figures in lost])
    return ConfidenceSummary(
        tracker=name,
        departures=len(delays), declared=len(declared),
        declared_soon=sum(delay < RETURN_FRAMES for delay in declared),
        delay=median(declared) if declared else float('nan'),
        false_alarms=ratio_estimate(false_alarms, present),
        recovered_share=ratio_estimate(
            np.array([float(figures.recovered) for figures in lost]), false_alarms),
        lost_share=ratio_estimate(
            np.array([figures.lost_while_present / 1000 for figures in lost]), present),
        absent=sum(figures.absent for figures in back),
        claimed_share=ratio_estimate(np.array([float(figures.claimed) for figures in back]),
                                     np.array([float(figures.absent) for figures in back])),
        returns=sum(len(figures.delays) for figures in back), found=len(all_found),
        found_share=ratio_estimate(np.array([float(len(delays)) for delays in found]),
                                   np.array([float(len(figures.delays)) for figures in back])),
        found_delay=median(all_found) if all_found else float('nan'),
        mistaken=sum(figures.mistaken for figures in back))
