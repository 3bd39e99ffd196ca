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

"""What the node said about the frames of a recording, in a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.run_file import SequenceInfo
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.replay.player import Exchange

__all__ = ['Answers', 'in_parts', 'read_answers', 'write_answers']


@dataclass(frozen=True, eq=False)
class Answers:
    """
    What the node said about the frames of the recording, or of some of them.

    Attributes
    ----------
    states : ndarray of str, shape (n,)
        As on `~/status`; empty for frames that were dropped.
    scores, latencies : ndarray, shape (n,)
        NaN where there is none; latencies in milliseconds.
    boxes : ndarray, shape (n, 4)
        NaN where there is none.

    """

    states: npt.NDArray[np.str_]
    scores: npt.NDArray[np.float64]
    latencies: npt.NDArray[np.float64]
    boxes: npt.NDArray[np.float64]

    def part(self, start: int, end: int) -> Answers:
        """Return the answers to the frames from `start` to before `end`."""
        return Answers(*(values[start:end] for values in vars(self).values()))

    @property
    def trace(self) -> Trace:
        """The same for the figures of an evaluation."""
        return Trace(self.boxes, self.scores, self.states == 'lost', starts=(0,))


def write_answers(exchanges: Sequence[Exchange], path: Path) -> None:
    """Write one row for each frame that was sent."""
    with path.open('w', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(['stamp_ns', 'state', 'score', 'latency_ms', 'x', 'y', 'width', 'height'])
        for item in exchanges:
            if item.latency is None:
                writer.writerow([item.stamp, *[''] * 7])
                continue
            status, box = item.answer.status, item.answer.box
            shown = [''] * 4 if box is None else np.round(box.as_tuple(), 3).tolist()
            writer.writerow([item.stamp, status.state, status.score,
                             round(1e3 * item.latency, 3), *shown])


def read_answers(path: Path) -> Answers:
    """Return what `write_answers` wrote."""
    with path.open(newline='') as file:
        rows = list(csv.DictReader(file))

    def column(name: str) -> npt.NDArray[np.float64]:
        return np.array([float(row[name] or 'nan') for row in rows])

    return Answers(np.array([row['state'] for row in rows]), column('score'),
                   column('latency_ms'),
                   np.stack([column(name) for name in ('x', 'y', 'width', 'height')], axis=1))


def in_parts(parts: Sequence[SequenceInfo], answers: Answers) -> Iterator[Answers]:
    """Yield the answers to the frames of each part."""
    bounds = np.cumsum([0, *(len(part.ground_truth) for part in parts)]).tolist()
    for start, end in pairwise(bounds):
        yield answers.part(start, end)
