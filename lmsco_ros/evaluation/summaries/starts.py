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

"""What each tracker said soon after its starts, over a one-pass run."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.evaluation.protocols.starts import start_outcomes
from lmsco_ros.evaluation.run_file import EvaluationRun


@dataclass(frozen=True)
class StartSummary:
    """
    One tracker's starts in a one-pass run.

    Attributes
    ----------
    tracker : str
        Name.
    on_nothing, told, lost : int
        Starts on no target; how many of them were told, and how many ended in LOST, within
        30 frames.
    on_target, falsely_told, falsely_lost : int
        The same of starts on a target that is there in all of these frames.

    """

    tracker: str
    on_nothing: int
    told: int
    lost: int
    on_target: int
    falsely_told: int
    falsely_lost: int


def summarize_starts(run: EvaluationRun) -> tuple[StartSummary, ...]:
    """Return the summary of each tracker, in the order of the run."""
    return tuple(_summarize(run, name) for name in run.trackers)


def _summarize(run: EvaluationRun, name: str) -> StartSummary:
    outcomes = [outcome for sequence, trace in zip(run.sequences, run.traces[name], strict=True)
                for outcome in start_outcomes(sequence.ground_truth, trace)]
    nothing = [outcome for outcome in outcomes if outcome.on_nothing]
    target = [outcome for outcome in outcomes if not outcome.on_nothing]
    return StartSummary(
        name,
        on_nothing=len(nothing), told=sum(outcome.told for outcome in nothing),
        lost=sum(outcome.lost for outcome in nothing),
        on_target=len(target), falsely_told=sum(outcome.told for outcome in target),
        falsely_lost=sum(outcome.lost for outcome in target))
