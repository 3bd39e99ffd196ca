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

"""Which failures are worth a picture, and which frames of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.run_file import EvaluationRun

_LEAD = (-20, -10, -5, 0, 5, 20)
_LOST_OVERLAP = 0.1
_PER_TRACKER = 2
_GOOD_ENOUGH = 0.5


@dataclass(frozen=True)
class Failure:
    """A sequence that went badly for a tracker, and the frames that show how."""

    tracker: str
    sequence: int
    mean_overlap: float
    frames: tuple[int, ...]


def worst_failures(run: EvaluationRun) -> tuple[Failure, ...]:
    """
    Return up to two sequences for each tracker, the lowest mean overlaps first.

    Sequences with a mean overlap above one half are no failures.
    """
    result = []
    for name in run.trackers:
        overlaps = [sequence.overlaps(trace, in_image=run.protocol != 'ope')
                    for sequence, trace in zip(run.sequences, run.traces[name])]
        means = np.array([np.nanmean(values) for values in overlaps])
        for index in np.argsort(means, kind='stable')[:_PER_TRACKER]:
            if means[index] < _GOOD_ENOUGH:
                result.append(Failure(name, int(index), float(means[index]),
                                      _telling_frames(overlaps[index])))
    return tuple(result)


def _telling_frames(overlap: Array) -> tuple[int, ...]:
    """Return frames around the first loss, or around the worst frame without one."""
    lost = np.flatnonzero(overlap < _LOST_OVERLAP)
    moment = int(lost[0]) if lost.size else int(np.nanargmin(overlap))
    last = len(overlap) - 1
    return tuple(sorted({min(max(moment + lead, 0), last) for lead in _LEAD}))
