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

"""Whether the covariances of each tracker are honest, over a one-pass run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, ratio_estimate
from lmsco_ros.evaluation.protocols.consistency import (
    consistency_band, DIMENSIONS, largest_usual_error, normalized_errors)
from lmsco_ros.evaluation.run_file import EvaluationRun


@dataclass(frozen=True)
class ErrorFigures:
    """
    Errors of the position as multiples of what the covariance says.

    Attributes
    ----------
    frames : int
        Frames with a target and a covariance.
    mean : Estimate
        Mean of the normalized error squared; 2 is right.
    median : float
        Its median; 1.39 is right.
    inside : Estimate
        Share of frames whose target is within the ellipse of 95 %.

    """

    frames: int
    mean: Estimate
    median: float
    inside: Estimate

    @property
    def factor(self) -> float:
        """By what the covariance would have to be multiplied for a mean of 2."""
        return self.mean.value / DIMENSIONS


@dataclass(frozen=True)
class ConsistencySummary:
    """
    One tracker's covariances in a one-pass run.

    Attributes
    ----------
    tracker : str
        Name.
    band : tuple of float
        Between what the mean lies, at 95 %, for an honest covariance and so many sequences.
    everywhere : ErrorFigures
        Of all frames with a target, also those in which it was LOST.
    followed : ErrorFigures
        Of the frames in which a box was claimed that touches the target.

    """

    tracker: str
    band: tuple[float, float]
    everywhere: ErrorFigures
    followed: ErrorFigures


def summarize_consistency(run: EvaluationRun) -> tuple[ConsistencySummary, ...]:
    """Return the summary of each tracker that tells covariances, in the order of the run."""
    found = (_summarize(run, name) for name in run.trackers)
    return tuple(summary for summary in found if summary.everywhere.frames)


def consistency_parts(run: EvaluationRun) -> list[tuple[str, EvaluationRun]]:
    """Return the kinds of scene of the split, or the groups, and all sequences together."""
    scenes = run.context.get('scenes') or {
        group: (group,) for group in dict.fromkeys(item.group for item in run.sequences)}
    parts = [(f'{scene} ({", ".join(groups)})' if tuple(groups) != (scene,) else scene,
              run.only(tuple(groups))) for scene, groups in scenes.items()]
    parts = [(title, part) for title, part in parts if part.sequences]
    return parts + ([('all sequences', run)] if len(parts) > 1 else [])


def _summarize(run: EvaluationRun, name: str) -> ConsistencySummary:
    errors, followed = [], []
    for sequence, trace in zip(run.sequences, run.traces[name], strict=True):
        error = normalized_errors(sequence.ground_truth, trace)
        touched = ~trace.lost & (sequence.overlaps(trace, in_image=False) > 0)
        errors.append(error[np.isfinite(error)])
        followed.append(error[np.isfinite(error) & touched])
    told = sum(len(error) > 0 for error in errors)
    return ConsistencySummary(name, consistency_band(max(1, told)), _figures(errors),
                              _figures(followed))


def _figures(errors: list[Array]) -> ErrorFigures:
    counts = np.array([float(len(error)) for error in errors])
    pooled = np.concatenate(errors)
    return ErrorFigures(
        frames=len(pooled),
        mean=ratio_estimate(np.array([float(error.sum()) for error in errors]), counts),
        median=float(np.median(pooled)) if len(pooled) else float('nan'),
        inside=ratio_estimate(np.array([float((error <= largest_usual_error()).sum())
                                        for error in errors]), counts))
