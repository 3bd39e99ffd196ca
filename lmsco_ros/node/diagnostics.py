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
from dataclasses import replace
import threading
import time
from typing import NamedTuple

import numpy as np

from lmsco_ros.core.types import TrackResult, TrackState
from lmsco_ros.node.outcome import Outcome, Phase
from msg_adapters.status import Diagnosis, FrameStatus, FrameTimes, Level, Reading

# Latencies of the last ten seconds at 30 Hz.
_WINDOW = 300
_PERCENTILES = (50, 95, 99)
_ACCEPTED, _REFUSED = 'accepted', 'refused'
_LEVELS = {Phase.IDLE: Level.OK, Phase.DISABLED: Level.OK, Phase.REFUSED: Level.ERROR,
           Phase.FAILED: Level.ERROR}
_MESSAGES = {
    Phase.IDLE: 'no target; publish a box on init_box',
    Phase.DISABLED: 'disabled; call ~/set_enabled to go on',
    TrackState.TRACKING: 'tracking',
    TrackState.UNCERTAIN: 'uncertain: found, but not learned from',
    TrackState.LOST: 'lost: no box until the target is found again',
}


class Readings(NamedTuple):
    """Of the pixels under a box: in the units of the image, and in degrees Celsius."""

    target: Reading | None = None
    celsius: Reading | None = None


class Problem(NamedTuple):
    """What is wrong at the moment."""

    level: Level
    message: str


def frame_statuses(outcome: Outcome, dropped_frames: int, published: float,
                   read: Callable[[TrackResult], Readings]) -> list[FrameStatus]:
    """
    Return what ~/status says about one frame: of each target, the selected one first.

    A start that is refused has an entry of its own behind those of the targets.

    Parameters
    ----------
    outcome : Outcome
        Of the frame.
    dropped_frames : int
        Of the worker.
    published : float
        When the box went out, on the clock of `time.monotonic`.
    read : callable
        Returns the readings of the pixels under the box of a result.

    """
    stations = (outcome.frame.received, outcome.started, outcome.finished, published)
    since_1970 = time.time() - time.monotonic()
    phase, start = outcome.phase, outcome.start
    frame = FrameStatus(
        phase.value, outcome.track_id, None, (published - outcome.frame.received) * 1e3,
        (outcome.finished - outcome.started) * 1e3, dropped_frames,
        times=FrameTimes(*(since_1970 + at for at in stations)))
    selected_first = sorted(outcome.results, key=lambda number: number != outcome.track_id)
    statuses = [_target_status(frame, outcome, number, read) for number in selected_first]
    if start is not None and not start.accepted:
        return [*statuses, replace(
            frame, state=phase.value if not statuses else Phase.REFUSED.value,
            level=Level.ERROR, message=start.reason, start=_REFUSED)]
    return statuses or [replace(
        frame, level=_LEVELS[phase], message=outcome.error or _MESSAGES[phase])]


def _target_status(frame: FrameStatus, outcome: Outcome, number: int,
                   read: Callable[[TrackResult], Readings]) -> FrameStatus:
    """Return the status of one target in a frame."""
    result, start = outcome.results[number], outcome.start
    message = '; '.join(filter(None, (_MESSAGES[result.state], result.note)))
    if number in outcome.dropped:
        message = 'lost for too long: the target is dropped (drop_after)'
    started = start is not None and start.number == number
    if start is not None and started:
        places = ', '.join(map(str, start.replaced))
        message += '; the start is accepted' + (f' in place of target {places}' if places else '')
    readings = Readings() if result.state is TrackState.LOST else read(result)
    return replace(
        frame, state=result.state.value, track_id=number, score=float(result.score),
        level=Level.OK if result.state is TrackState.TRACKING else Level.WARN, message=message,
        target=readings.target, target_celsius=readings.celsius,
        start=_ACCEPTED if started else '')


def refused_status(reason: str, track_id: int, dropped_frames: int, *,
                   start: bool = False) -> FrameStatus:
    """Return what ~/status says about a message, of a start or not, that cannot be used."""
    return FrameStatus(Phase.REFUSED.value, track_id, None, 0.0, 0.0, dropped_frames,
                       Level.ERROR, reason, start=_REFUSED if start else '')


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
            self._counts['refused'] += outcome.refused
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
