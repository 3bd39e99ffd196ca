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


"""Health figures are computed from what happened, on a clock that the test moves."""

from dataclasses import replace

import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.diagnostics import (
    frame_statuses, HealthMonitor, Problem, Readings, refused_status)
from lmsco_ros.node.outcome import Outcome, PendingFrame, Phase
from msg_adapters.status import Level, Reading

BOX = BoundingBox(1, 2, 3, 4)


class Clock:
    """Time that stands still until it is moved."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def outcome(phase=Phase.TRACKED, state=TrackState.TRACKING, *, live=True, error='', **more):
    result = TrackResult(BOX, 0.5, state, np.zeros((2, 2), np.float32), BOX)
    frame = PendingFrame(None, 0, 0.0)
    return Outcome(frame, phase, {3: result} if phase is Phase.TRACKED else {}, 3, live, error,
                   0.006, 0.010, **more)


def test_note_of_a_result_is_told_with_its_state():
    noted = outcome(state=TrackState.UNCERTAIN)
    noted.results[3] = replace(noted.results[3], note='start: nothing stands out')
    status, = frame_statuses(noted, 0, 0.02, lambda result: Readings())
    assert status.message == (
        'uncertain: found, but not learned from; start: nothing stands out')


def report(monitor, **values):
    return monitor.report('node', **{'problem': None, 'dropped_frames': 0, **values})


def test_rate_and_silence_follow_the_clock():
    clock = Clock()
    monitor = HealthMonitor(clock)
    for number in range(61):
        clock.now += 1 / 30
        monitor.received(number)
    assert float(report(monitor).values['image_rate_hz']) == pytest.approx(30, abs=0.1)
    clock.now += 7
    assert monitor.silence() == pytest.approx(7)
    assert report(monitor).values['image_rate_hz'] == '0.0'
    monitor.restart()
    assert monitor.silence() == 0


def test_latency_counts_live_frames_only():
    monitor = HealthMonitor()
    for milliseconds in range(101):
        monitor.published(outcome(), milliseconds / 1e3)
    monitor.published(outcome(live=False), 9.0)
    values = report(monitor).values
    assert [values[f'latency_p{p}_ms'] for p in (50, 95, 99)] == ['50.00', '95.00', '99.00']


def test_backward_stamps_are_noticed():
    monitor = HealthMonitor()
    assert [monitor.received(stamp) for stamp in (5, 6, 6, 2, 3)] == [
        False, False, False, True, False]
    assert report(monitor).values['backward_stamps'] == '1'


def test_level_and_message_tell_what_is_wrong():
    monitor = HealthMonitor()
    assert report(monitor).level == Level.OK
    monitor.answered(outcome(state=TrackState.LOST))
    assert (report(monitor).level, report(monitor).message) == (Level.OK, 'lost')
    stale = report(monitor, problem=Problem(Level.STALE, 'no image'))
    assert (stale.level, stale.message) == (Level.STALE, 'no image')
    monitor.refused('what encoding is this')
    assert report(monitor).level == Level.ERROR
    assert report(monitor).message == 'what encoding is this'
    monitor.answered(outcome())
    assert report(monitor).level == Level.OK
    assert report(monitor).values['last_error'] == 'what encoding is this'
    monitor.warned('no memory')
    assert (report(monitor).level, report(monitor).message) == (Level.WARN, 'no memory')
    monitor.warned('')
    assert report(monitor).level == Level.OK


@pytest.mark.parametrize('given, state, level', [
    (outcome(), 'tracking', Level.OK),
    (outcome(state=TrackState.UNCERTAIN), 'uncertain', Level.WARN),
    (outcome(state=TrackState.LOST), 'lost', Level.WARN),
    (outcome(Phase.IDLE), 'idle', Level.OK),
    (outcome(Phase.DISABLED), 'disabled', Level.OK),
    (outcome(Phase.REFUSED, error='why'), 'refused', Level.ERROR),
    (outcome(Phase.FAILED, error='why'), 'failed', Level.ERROR),
])
def test_frame_status_tells_state_and_figures(given, state, level):
    status, = frame_statuses(given, 7, 0.012, lambda result: Readings(Reading(1, 2, 3)))
    assert (status.state, status.level, status.track_id, status.dropped_frames) == (
        state, level, 3, 7)
    assert (status.latency_ms, status.tracker_ms) == (12, pytest.approx(4))
    assert np.diff(status.times) == pytest.approx([0.006, 0.004, 0.002], abs=1e-5)
    seen = given.result is not None and state != 'lost'
    assert (status.target, status.target_celsius) == (Reading(1, 2, 3) if seen else None, None)
    assert status.score == (0.5 if given.result else None)
    assert status.message and (not given.error or status.message == 'why')


def test_refused_status_carries_the_reason():
    status = refused_status('why', 2, 1)
    assert (status.state, status.message, status.track_id) == ('refused', 'why', 2)
