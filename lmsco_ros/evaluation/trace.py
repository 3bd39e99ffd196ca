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

"""What a tracker did on one sequence: the only thing that figures are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.plain_values import (
    box_rows, number, numbers, the_list, the_text, whole_number, whole_numbers)

_DECIMALS = 4
_DIGITS = 5
# What a symmetric matrix is stored as.
_ROWS, _COLUMNS = np.triu_indices(4)


@dataclass(frozen=True, eq=False)
class Trace:
    """
    Answers, starts and failures, and the time they took.

    Attributes
    ----------
    boxes : ndarray, shape (n, 4)
        Answer for each frame, the given box at a start; NaN where there is none.
    scores : ndarray, shape (n,)
        Score for each frame; NaN where there is none.
    lost : ndarray, shape (n,), bool
        Frames after which the tracker was LOST.
    starts, failures : tuple of int
        Frames at which it was started and, in the supervised protocol, failed.
    updates : int
        Number of updates that the times are for.
    cpu_seconds, wall_seconds : float
        Time in updates: of the process on all cores, and on the clock. NaN for the CPU
        time of a tracker that runs in another process.
    error : str or None
        What a crash said; frames from there on have no answer in the one-pass protocol
        and count as a failure in the supervised one.
    predicted : ndarray, shape (n, 4), or None
        Where the tracker took the target to be, also while it was lost; NaN where it did not
        say, None where it never does.
    covariances : ndarray, shape (n, 4, 4), or None
        Of center x, center y, width and height of these boxes, in px^2.

    """

    boxes: npt.NDArray[np.float64]
    scores: npt.NDArray[np.float64]
    lost: npt.NDArray[np.bool_]
    starts: tuple[int, ...]
    failures: tuple[int, ...] = ()
    updates: int = 0
    cpu_seconds: float = 0.0
    wall_seconds: float = 0.0
    error: str | None = None
    predicted: npt.NDArray[np.float64] | None = None
    covariances: npt.NDArray[np.float64] | None = None

    @classmethod
    def unanswered(cls, frames: int, error: str) -> Trace:
        """Return the trace of a tracker that died before it gave any answer."""
        return cls(boxes=np.full((frames, 4), np.nan), scores=np.full(frames, np.nan),
                   lost=np.zeros(frames, dtype=bool), starts=(), error=error)

    def to_json(self) -> dict[str, Any]:
        """Return the trace as plain lists and numbers, NaN as None."""
        return {
            'boxes': [_plain(row) for row in self.boxes],
            'scores': _plain(self.scores),
            'lost': np.flatnonzero(self.lost).tolist(),
            'starts': list(self.starts),
            'failures': list(self.failures),
            'updates': self.updates,
            'cpu_seconds': None if np.isnan(self.cpu_seconds) else self.cpu_seconds,
            'wall_seconds': self.wall_seconds,
            'error': self.error,
            'predicted': self._written(self.predicted),
            'covariances': self._written(
                None if self.covariances is None else self.covariances[:, _ROWS, _COLUMNS]),
        }

    @staticmethod
    def _written(rows: npt.NDArray[np.float64] | None) -> list[list[float] | None] | None:
        """Return rows of numbers, None for those of NaN; None where all of them are."""
        if rows is None or not np.isfinite(rows).any():
            return None
        return [[float(f'{value:.{_DIGITS}g}') for value in row]
                if np.isfinite(row).all() else None for row in rows]

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Trace:
        """
        Return the trace that `to_json` described.

        Raises
        ------
        KeyError, OverflowError, TypeError, ValueError
            When `content` is something else.

        """
        boxes, scores = box_rows(content['boxes']), numbers(the_list(content['scores']))
        if len(boxes) != len(scores):
            raise ValueError(f'{len(boxes)} boxes but {len(scores)} scores')
        lost = np.zeros(len(scores), dtype=bool)
        lost[whole_numbers(content['lost'], len(scores))] = True
        error, seconds = content['error'], content['cpu_seconds']
        predicted, covariances = _motion(content, len(scores))
        return cls(boxes=boxes, scores=scores, lost=lost,
                   starts=tuple(whole_numbers(content['starts'], len(scores))),
                   failures=tuple(whole_numbers(content['failures'], len(scores))),
                   updates=whole_number(content['updates']),
                   cpu_seconds=np.nan if seconds is None else number(seconds),
                   wall_seconds=number(content['wall_seconds']),
                   error=None if error is None else the_text(error),
                   predicted=predicted, covariances=covariances)


def _motion(content: Mapping[str, Any], frames: int) -> tuple[
        npt.NDArray[np.float64] | None, npt.NDArray[np.float64] | None]:
    """Return predicted boxes and their covariances, None in records of trackers without them."""
    if content.get('predicted') is None and content.get('covariances') is None:
        return None, None
    predicted = box_rows(content['predicted'])
    rows = [[None] * len(_ROWS) if row is None else the_list(row)
            for row in the_list(content['covariances'])]
    if len(predicted) != frames or len(rows) != frames or any(
            len(row) != len(_ROWS) for row in rows):
        raise ValueError(f'predicted boxes and covariances are not those of {frames} frames')
    covariances = np.empty((frames, 4, 4))
    values = numbers(item for row in rows for item in row).reshape(frames, -1)
    covariances[:, _ROWS, _COLUMNS] = covariances[:, _COLUMNS, _ROWS] = values
    return predicted, covariances


def _plain(values: npt.NDArray[np.float64]) -> list[float | None]:
    return [round(float(value), _DECIMALS) if np.isfinite(value) else None for value in values]
