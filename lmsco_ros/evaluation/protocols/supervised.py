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
The VOT supervised protocol: after a failure the tracker is started again.

Kristan et al., "A Novel Performance Evaluation Methodology for Single-Target
Trackers" (2016). A failure is a frame without overlap; the next start is
`RESTART_GAP` frames later. Overlap counts inside the image only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.geometry import Array

RESTART_GAP = 5
BURN_IN = 10
SENSITIVITY = 30.0


@dataclass(frozen=True)
class Fragment:
    """
    What happened between one start and the failure or end that followed.

    Attributes
    ----------
    overlaps : ndarray, shape (n,)
        Overlap of each frame from the start on; the first entry is the start itself.
    failed : bool
        Whether the fragment ended with a failure rather than with the sequence.

    """

    overlaps: Array
    failed: bool


def counted_frames(frames: int, starts: Sequence[int], failures: Sequence[int],
                   burn_in: int = BURN_IN) -> npt.NDArray[np.bool_]:
    """
    Return which frames count for accuracy, shape (frames,).

    Those are the frames between a start and the next failure without the first
    `burn_in` ones (the start included), and without the failure itself.
    """
    counted = np.zeros(frames, dtype=bool)
    for start, end in _spans(frames, starts, failures):
        counted[min(start + burn_in, end):end] = True
    return counted


def accuracy(overlap: Array, starts: Sequence[int], failures: Sequence[int],
             burn_in: int = BURN_IN) -> float:
    """
    Return the mean overlap while tracking, in [0, 1].

    Parameters
    ----------
    overlap : ndarray, shape (n,)
        Overlap for each frame; NaN (target absent) is left out.
    starts, failures : sequence of int
        Frames of starts and failures.
    burn_in : int, default 10
        Frames after each start that do not count, as they flatter.

    Returns
    -------
    float
        0 where no frame counts, as in the VOT toolkit.

    """
    values = overlap[counted_frames(len(overlap), starts, failures, burn_in)]
    values = values[np.isfinite(values)]
    return float(values.mean()) if values.size else 0.0


def reliability(failures: float, frames: float, sensitivity: float = SENSITIVITY) -> float:
    """Return the chance to survive `sensitivity` frames, exp(-S * failures / frames)."""
    return math.exp(-sensitivity * failures / frames)


def fragments(overlap: Array, starts: Sequence[int], failures: Sequence[int]) -> list[Fragment]:
    """
    Return the stretches of tracking for the expected overlap.

    Frames without a target are taken out, since nothing can be expected there.
    """
    result = []
    for start, end in _spans(len(overlap), starts, failures):
        stretch = overlap[start:end]
        result.append(Fragment(stretch[np.isfinite(stretch)], failed=end in set(failures)))
    return result


def _spans(frames: int, starts: Sequence[int],
           failures: Sequence[int]) -> list[tuple[int, int]]:
    """Return (start, end) pairs, the end being the failure or the end of the sequence."""
    spans = []
    for start in starts:
        later = [failure for failure in failures if failure >= start]
        spans.append((start, min(later, default=frames)))
    return spans
