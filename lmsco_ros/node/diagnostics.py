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

"""Health of the node: figures of every frame, and what a person should know once a second."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import threading
import time
from typing import NamedTuple

import numpy as np

from lmsco_ros.core.types import TrackState
from lmsco_ros.node.outcome import Outcome, Phase
from msg_adapters.status import Diagnosis, FrameStatus, FrameTimes, Level, Reading

# Latencies of the last ten seconds at 30 Hz.
_WINDOW = 300
_PERCENTILES = (50, 95, 99)
_LEVELS = {Phase.IDLE: Level.OK, Phase.DISABLED: Level.OK, Phase.REFUSED: Level.ERROR,
           Phase.FAILED: Level.ERROR}
_MESSAGES = {
    Phase.IDLE: 'no target; publish a box on init_box',
    Phase.DISABLED: 'disabled; call ~/set_enabled to go on',
    TrackState.TRACKING: 'tracking',
    TrackState.UNCERTAIN: 'uncertain: found, but not learned from',
    TrackState.LOST: 'lost: no box until the target is found again',
}


class Problem(NamedTuple):
    """What is wrong at the moment."""

    level: Level
    message: str


def frame_status(outcome: Outcome, dropped_frames: int, published: float, *,
                 target: Reading | None = None,
                 target_celsius: Reading | None = None) -> FrameStatus:
    """
    Return what ~/status says about one frame.

    Parameters
    ----------
    outcome : Outcome
        Of the frame.
    dropped_frames : int
        Of the worker.
    published : float
        When the box went out, on the clock of `time.monotonic`.
    target, target_celsius : Reading or None
        Of the pixels under the box.

    """
    result, phase = outcome.result, outcome.phase
    if result is None:
        state, level = phase.value, _LEVELS[phase]
        message = outcome.error or _MESSAGES[phase]
    else:
        state, message = result.state.value, _MESSAGES[result.state]
        level = Level.OK if result.state is TrackState.TRACKING else Level.WARN
    stations = (outcome.frame.received, outcome.started, outcome.finished, published)
    since_1970 = time.time() - time.monotonic()
    return FrameStatus(
        state, outcome.track_id, None if result is None else float(result.score),
        (published - outcome.frame.received) * 1e3, (outcome.finished - outcome.started) * 1e3,
        dropped_frames, level, message, FrameTimes(*(since_1970 + at for at in stations)),
        target, target_celsius)


def refused_status(reason: str, track_id: int, dropped_frames: int) -> FrameStatus:
    """Return what ~/status says about a message that cannot be used."""
    return FrameStatus(Phase.REFUSED.value, track_id, None, 0.0, 0.0, dropped_frames,
                       Level.ERROR, reason)


class HealthMonitor:
    """
    Counts what happens; may be used by several threads.

    Parameters
    ----------
    clock : callable
        Returns seconds; for tests.

    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._latencies: deque[float] = deque(maxlen=_WINDOW)
        self._arrivals: deque[float] = deque(maxlen=_WINDOW)
        self._newest_stamp = 0
        self._counts = dict.fromkeys(('received', 'tracked', 'refused', 'tracker_errors',
                                      'backward_stamps', 'faults'), 0)
        self._last_error = ''
        self._warning = ''
        self._state = Phase.IDLE.value
        self.restart()

    def restart(self) -> None:
        """Begin to wait for images anew."""
        with self._lock:
            self._waiting_since = self._clock()
            self._arrivals.clear()

    def received(self, stamp: int) -> bool:
        """Note an image; return whether its stamp went backwards."""
        with self._lock:
            now = self._clock()
            backwards = stamp < self._newest_stamp
            self._newest_stamp = stamp
            self._waiting_since = now
            self._arrivals.append(now)
            self._counts['received'] += 1
            self._counts['backward_stamps'] += backwards
            return backwards

    def refused(self, reason: str) -> None:
        """Note an image or a request that could not be used."""
        with self._lock:
            self._counts['refused'] += 1
            self._last_error = reason
            self._state = Phase.REFUSED.value

    def turned_away(self, reason: str) -> None:
        """Note a request that says nothing about the images and was refused."""
        with self._lock:
            self._counts['refused'] += 1
            self._last_error = reason

    def faulted(self, text: str) -> None:
        """Note a request that was given up because of what nobody expects."""
        with self._lock:
            self._counts['faults'] += 1
            self._last_error = text

    def warned(self, warning: str) -> None:
        """Remember what stays wrong until the node is configured again; empty forgets it."""
        with self._lock:
            self._warning = warning

    def answered(self, outcome: Outcome) -> None:
        """Note what became of a frame."""
        with self._lock:
            self._counts['tracked'] += outcome.phase is Phase.TRACKED
            self._counts['refused'] += outcome.phase is Phase.REFUSED
            self._counts['tracker_errors'] += outcome.phase is Phase.FAILED
            self._last_error = outcome.error or self._last_error
            self._state = (outcome.phase if outcome.result is None
                           else outcome.result.state).value

    def published(self, outcome: Outcome, at: float) -> None:
        """Note when the answer to a frame went out, on the clock of `time.monotonic`."""
        with self._lock:
            if outcome.live:
                self._latencies.append(at - outcome.frame.received)

    def silence(self) -> float:
        """Return the seconds since the last image, or since the node began to wait."""
        with self._lock:
            return self._clock() - self._waiting_since

    def report(self, name: str, *, problem: Problem | None, dropped_frames: int) -> Diagnosis:
        """
        Sum up.

        Parameters
        ----------
        name : str
            Who is meant.
        problem : Problem or None
            What is wrong at the moment, if anything is.
        dropped_frames : int
            Of the worker.

        """
        with self._lock:
            percentiles = np.percentile(self._latencies or [0.0], _PERCENTILES) * 1e3
            values = {'state': self._state, 'image_rate_hz': f'{self._rate():.1f}'}
            values |= {key: str(count) for key, count in self._counts.items()}
            values |= {'dropped_frames': str(dropped_frames)}
            values |= {f'latency_p{percentile}_ms': f'{value:.2f}'
                       for percentile, value in zip(_PERCENTILES, percentiles)}
            values |= {'last_error': self._last_error}
            warning = self._warning
        if problem is None and values['state'] == Phase.REFUSED.value:
            problem = Problem(Level.ERROR, values['last_error'])
        if problem is None and warning:
            problem = Problem(Level.WARN, warning)
        level, message = problem or Problem(Level.OK, values['state'])
        return Diagnosis(name, level, message, values)

    def _rate(self) -> float:
        """Return images per second, over the arrivals that are remembered."""
        recent = [arrival for arrival in self._arrivals if arrival > self._clock() - 5]
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 \
            and recent[-1] > recent[0] else 0.0
