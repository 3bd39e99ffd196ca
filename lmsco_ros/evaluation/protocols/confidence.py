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

"""How far a tracker's own word can be trusted: its score, and when it says LOST or found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.geometry import Array, has_jumped, is_absent
from lmsco_ros.evaluation.trace import Trace

Flags = npt.NDArray[np.bool_]

GOOD_OVERLAP = 0.5

# Frames after its return in which a target counts as found again.
RETURN_FRAMES = 30


@dataclass(frozen=True)
class LostFigures:
    """
    When LOST was declared in one sequence.

    Attributes
    ----------
    delays : tuple of int or None
        For each time the target left: frames until the first LOST, None when it was not
        declared before the target came back or the sequence ended.
    false_alarms : int
        Times LOST was declared while the target was there and the box, one frame
        before, overlapped it by more than `GOOD_OVERLAP`.
    recovered : int
        Of these, after which a box, not LOST, overlapped the target by as much within
        `RETURN_FRAMES`.
    frames_present : int
        Frames with the target in the image.
    lost_while_present : int
        Of these, frames in state LOST, whether justified or not.

    """

    delays: tuple[int | None, ...]
    false_alarms: int
    recovered: int
    frames_present: int
    lost_while_present: int


@dataclass(frozen=True)
class ReturnFigures:
    """
    What was said in one sequence while the target was away, and after it was back.

    A target returns when it is there after an absence, or jumps by more than two of its
    sizes from one frame to the next. Returns that last for fewer than `RETURN_FRAMES` frames
    do not count.

    Attributes
    ----------
    absent : int
        Frames without the target since the tracker was started.
    claimed : int
        Of these, frames for which a box was given and the state was not LOST.
    delays : tuple of int or None
        For each return: frames until a box, not LOST, overlapped the target by more than
        `GOOD_OVERLAP`; None when that took `RETURN_FRAMES` or more.
    mistaken : int
        Returns after which, within `RETURN_FRAMES` and before the target was found again, a
        box without any overlap was given while the state was not LOST.

    """

    absent: int
    claimed: int
    delays: tuple[int | None, ...]
    mistaken: int


def auroc_terms(scores: Sequence[Array], overlap: Sequence[Array]) -> tuple[Array, Array, Array]:
    """
    Return the pair counts that the AUROC over any choice of sequences is made of.

    Parameters
    ----------
    scores : sequence of ndarray
        For each sequence, the tracker's score for each frame; NaN where it gave none.
    overlap : sequence of ndarray
        Overlap for each frame; good is above 0.5. NaN where the target is absent.

    Returns
    -------
    ordered : ndarray, shape (sequences, sequences)
        Pairs of a good frame of sequence i and a bad one of sequence j in which the good
        one has the higher score, ties counted half.
    good, bad : ndarray, shape (sequences,)
        Number of good and of bad frames with a score.

    """
    kept = [np.isfinite(score) & np.isfinite(value) for score, value in zip(scores, overlap)]
    good = [score[keep & (value > GOOD_OVERLAP)]
            for score, value, keep in zip(scores, overlap, kept)]
    bad = [np.sort(score[keep & (value <= GOOD_OVERLAP)])
           for score, value, keep in zip(scores, overlap, kept)]
    ordered = np.array([[(np.searchsorted(low, high, 'left').sum()
                          + np.searchsorted(low, high, 'right').sum()) / 2
                         for low in bad] for high in good])
    return ordered, np.array([float(len(part)) for part in good]), np.array(
        [float(len(part)) for part in bad])


def mean_auroc(ordered: Array, good: Array, bad: Array, weights: Array) -> Array:
    """
    Return the mean of the AUROC of each sequence, of those with both good and bad frames.

    Parameters and shapes are those of :func:`auroc`, which pools the frames of all sequences.
    """
    pairs = good * bad
    own = np.divide(np.diag(ordered), pairs, out=np.zeros(len(good)), where=pairs > 0)
    counted = weights @ (pairs > 0).astype(float)
    return np.divide(weights @ own, counted, out=np.full(np.shape(counted), np.nan),
                     where=counted > 0)


def auroc(ordered: Array, good: Array, bad: Array, weights: Array) -> Array:
    """
    Return the chance that a good frame is scored above a bad one.

    Parameters
    ----------
    ordered, good, bad : ndarray
        Pair counts from `auroc_terms`.
    weights : ndarray, shape (..., sequences)
        How often each sequence counts.

    Returns
    -------
    ndarray, shape (...)
        Area under the receiver operating characteristic in [0, 1]; NaN unless there are
        both good and bad frames.

    """
    pairs = (weights @ good) * (weights @ bad)
    right = np.einsum('...i,ij,...j->...', weights, ordered, weights)
    return np.divide(right, pairs, out=np.full(np.shape(pairs), np.nan), where=pairs > 0)


def lost_figures(lost: Flags, overlap: Array) -> LostFigures:
    """
    Return how fast and how falsely LOST was declared.

    Parameters
    ----------
    lost : ndarray, shape (n,), bool
        Whether the tracker was LOST after each frame.
    overlap : ndarray, shape (n,)
        Overlap for each frame; NaN where the target is absent.

    """
    absent = ~np.isfinite(overlap)
    onsets = np.flatnonzero(lost[1:] & ~lost[:-1]) + 1
    false = [frame for frame in onsets
             if not absent[frame] and overlap[frame - 1] > GOOD_OVERLAP]
    found = ~lost & (overlap > GOOD_OVERLAP)
    return LostFigures(
        delays=tuple(_delay(lost[start:end]) for start, end in _absences(absent)),
        false_alarms=len(false),
        recovered=sum(bool(found[frame:frame + RETURN_FRAMES].any()) for frame in false),
        frames_present=int((~absent).sum()),
        lost_while_present=int((lost & ~absent).sum()))


def return_figures(ground_truth: Array, trace: Trace, overlap: Array) -> ReturnFigures:
    """
    Return how the absences and returns of the target went in one sequence.

    Parameters
    ----------
    ground_truth : ndarray, shape (n, 4)
        True boxes, NaN where absent.
    trace : Trace
        Answers of the tracker.
    overlap : ndarray, shape (n,)
        Overlap of the two for each frame; NaN where the target is absent.

    """
    absent = is_absent(ground_truth)
    claimed = ~trace.lost & ~is_absent(trace.boxes)
    started = np.arange(len(absent)) > (trace.starts[0] if trace.starts else 0)
    outcomes = [_outcome(claimed[start:start + RETURN_FRAMES],
                         overlap[start:start + RETURN_FRAMES])
                for start in _returns(ground_truth, started)]
    return ReturnFigures(
        absent=int((absent & started).sum()),
        claimed=int((absent & started & claimed).sum()),
        delays=tuple(delay for delay, _ in outcomes),
        mistaken=sum(mistaken for _, mistaken in outcomes))


def _outcome(claimed: Flags, overlap: Array) -> tuple[int | None, bool]:
    """Return the delay of a return, and whether a box was claimed elsewhere before."""
    delay = _delay(claimed & (overlap > GOOD_OVERLAP))
    return delay, bool((claimed & (overlap == 0))[:delay].any())


def _returns(ground_truth: Array, started: Flags) -> list[int]:
    """Return the first frame of each return that lasts long enough."""
    absent = is_absent(ground_truth)
    jumped = has_jumped(ground_truth)[1:]
    starts = np.flatnonzero(started[1:] & ~absent[1:] & (absent[:-1] | jumped)) + 1
    ends = np.append(starts[1:], len(absent))
    return [int(start) for start, end in zip(starts, ends)
            if (~absent[start:end]).cumprod().sum() >= RETURN_FRAMES]


def _absences(absent: Flags) -> list[tuple[int, int]]:
    """Return (first frame, frame after the last) of each absence that began in sight."""
    steps = np.diff(absent.astype(int), append=0)
    starts = np.flatnonzero(steps[:-1] == 1) + 1
    return [(int(start), int(start + np.argmin(np.append(absent[start:], False))))
            for start in starts]


def _delay(lost: Flags) -> int | None:
    return int(np.argmax(lost)) if lost.any() else None
