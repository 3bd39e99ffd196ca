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

"""Let a tracker run over a sequence, once or with a new start after each failure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import time

import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, TrackState
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent, overlaps
from lmsco_ros.evaluation.protocols.supervised import RESTART_GAP
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers.interface import Answer, EvaluatedTracker


def run_one_pass(tracker: EvaluatedTracker, sequence: TrackingSequence) -> Trace:
    """
    Start on the first frame with a target and track to the end.

    Returns
    -------
    Trace
        With `error` set and no answers from there on when the tracker raised.

    """
    recorder = _Recorder(tracker, sequence)
    start = _next_start(sequence, 0)
    if start is not None and recorder.start(start):
        for index in range(start + 1, len(sequence)):
            if not recorder.update(index):
                break
    return recorder.trace(failures=())


def run_supervised(tracker: EvaluatedTracker, sequence: TrackingSequence) -> Trace:
    """
    Track to the end, with a new start five frames after each frame without overlap.

    A tracker that raises has failed on that frame too. Frames without a target neither
    fail nor start.
    """
    recorder = _Recorder(tracker, sequence)
    failures: list[int] = []
    start: int | None = _next_start(sequence, 0)
    while start is not None:
        failure = _track_until_failure(recorder, start)
        if failure is None:
            break
        failures.append(failure)
        start = _next_start(sequence, failure + RESTART_GAP)
    return recorder.trace(failures=tuple(failures))


PROTOCOLS: Mapping[str, Callable[[EvaluatedTracker, TrackingSequence], Trace]] = {
    'ope': run_one_pass,
    'vot': run_supervised,
    # Its starts are the first frames of parts of sequences.
    'anchors': run_one_pass,
}


def _track_until_failure(recorder: _Recorder, start: int) -> int | None:
    if not recorder.start(start):
        return start
    for index in range(start + 1, recorder.frames):
        if not recorder.update(index) or recorder.missed(index):
            return index
    return None


def _next_start(sequence: TrackingSequence, index: int) -> int | None:
    present = np.flatnonzero(~is_absent(sequence.ground_truth[index:]))
    return index + int(present[0]) if present.size else None


class _Recorder:
    """Drives the tracker and writes down answers and times."""

    def __init__(self, tracker: EvaluatedTracker, sequence: TrackingSequence) -> None:
        self._tracker = tracker
        self._sequence = sequence
        self.frames = len(sequence)
        self._boxes = np.full((self.frames, 4), np.nan)
        self._scores = np.full(self.frames, np.nan)
        self._lost = np.zeros(self.frames, dtype=bool)
        self._predicted = np.full((self.frames, 4), np.nan)
        self._covariances = np.full((self.frames, 4, 4), np.nan)
        self._starts: list[int] = []
        self._updates = 0
        self._wall = 0.0
        self._cpu = 0.0 if tracker.in_process else float('nan')
        self._size = (1, 1)
        self._errors: list[str] = []

    def start(self, index: int) -> bool:
        """Start the tracker on the true box; return whether it took it."""
        image = self._image(index)
        self._size = image.shape[1], image.shape[0]
        self._starts.append(index)
        self._boxes[index] = self._sequence.ground_truth[index]
        box = BoundingBox(*self._boxes[index].tolist())
        try:
            self._tracker.initialize(image, box)
        except Exception as error:  # Whatever a tracker throws is a result, not an accident.
            self._boxes[index] = np.nan
            return self._note(index, error)
        return True

    def update(self, index: int) -> bool:
        """Track into frame `index`; return whether the tracker answered."""
        image = self._image(index)
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            answer = self._tracker.update(image)
            self._cpu += time.process_time() - cpu
            self._wall += time.perf_counter() - wall
            self._updates += 1
            self._write(index, answer)
        except Exception as error:  # As above, and so is what is no answer.
            return self._note(index, error)
        return True

    def missed(self, index: int) -> bool:
        """Return whether the answer has no overlap with a target that is there."""
        truth, box = self._sequence.ground_truth[[index]], self._boxes[[index]]
        return bool(overlaps(truth, box, self._size)[0] == 0)

    def trace(self, failures: tuple[int, ...]) -> Trace:
        """Return what was written down."""
        return Trace(boxes=self._boxes, scores=self._scores, lost=self._lost,
                     predicted=self._predicted, covariances=self._covariances,
                     starts=tuple(self._starts), failures=failures, updates=self._updates,
                     cpu_seconds=self._cpu, wall_seconds=self._wall,
                     error='; '.join(self._errors) or None)

    def _image(self, index: int) -> npt.NDArray:
        try:
            return self._sequence.frames[index]
        except (OSError, IndexError) as error:
            raise SequenceError(f'frame {index} cannot be read: {error}') from error

    def _write(self, index: int, answer: Answer) -> None:
        if answer.box is not None:
            self._boxes[index] = answer.box.as_tuple()
        if answer.score is not None:
            self._scores[index] = answer.score
        self._lost[index] = answer.state is TrackState.LOST
        if answer.predicted_box is not None and answer.covariance is not None:
            self._predicted[index] = answer.predicted_box.as_tuple()
            self._covariances[index] = answer.covariance

    def _note(self, index: int, error: Exception) -> bool:
        self._errors.append(f'frame {index}: {type(error).__name__}: {error}')
        return False
