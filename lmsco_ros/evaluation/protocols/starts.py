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

"""What a tracker says within a second of a start: of a target, and where there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array, is_absent
from lmsco_ros.evaluation.protocols.confidence import RETURN_FRAMES
from lmsco_ros.evaluation.trace import Trace

DOUBTFUL = 0.5


@dataclass(frozen=True)
class StartOutcome:
    """
    What was said in the `RETURN_FRAMES` frames after one start.

    Attributes
    ----------
    on_nothing : bool
        Whether there was no target in any of them; else there was one in all.
    told : bool
        Whether most of them had a score below `DOUBTFUL`, were LOST or had no box.
    lost : bool
        Whether the tracker was LOST, or gave no box any more, in one of them.

    """

    on_nothing: bool
    told: bool
    lost: bool


def start_outcomes(ground_truth: Array, trace: Trace) -> Iterator[StartOutcome]:
    """
    Yield the outcome of each start that is followed by enough frames with or without a target.

    Parameters
    ----------
    ground_truth : ndarray, shape (n, 4)
        True boxes, NaN where absent.
    trace : Trace
        Answers of the tracker; without a score, a box is a claim.

    """
    absent = is_absent(ground_truth)
    ends = (*trace.starts, len(absent))[1:]
    for start, end in zip(trace.starts, ends, strict=True):
        after = slice(start + 1, min(start + 1 + RETURN_FRAMES, end))
        away = absent[after]
        if len(away) < RETURN_FRAMES or away.any() != away.all():
            continue
        lost = trace.lost[after] | is_absent(trace.boxes[after])
        trust = np.where(lost, 0.0, np.nan_to_num(trace.scores[after], nan=1.0))
        yield StartOutcome(bool(away.all()), bool(np.median(trust) < DOUBTFUL), bool(lost.any()))
