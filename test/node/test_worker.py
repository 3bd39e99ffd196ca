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


"""The worker keeps the order, bounds the delay, and survives its tracker; no ROS."""

from pathlib import Path
import subprocess
import sys
import threading
import time

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.history import FrameHistory
from lmsco_ros.node.mailbox import BoundedMailbox, LatestMailbox
from lmsco_ros.node.outcome import Frame, Phase
from lmsco_ros.node.worker import TrackerWorker

REPOSITORY = Path(__file__).resolve().parents[2]
PATIENCE = 20.0
BOX = BoundingBox(1, 2, 3, 4)
SECOND = 10 ** 9


class Recorder:
    """A tracker that notes its calls, and holds them while the gate is closed."""

    def __init__(self):
        self.calls, self.error = [], None
        self.gate = threading.Event()
        self.gate.set()
        self.entered = threading.Event()

    def initialize(self, image, box):
        return self._answer('initialize', image, box)

    def update(self, image):
        return self._answer('update', image, BOX)

    def _answer(self, call, image, box):
        self.calls.append((call, int(image[0, 0])))
        self.entered.set()
        assert self.gate.wait(PATIENCE)
        error, self.error = self.error, None
        if error:
            raise error
        return TrackResult(box, 1.0, TrackState.TRACKING, np.zeros((2, 2), np.float32), box)


class Bench:
    """A worker, its tracker and what it delivered."""

    def __init__(self, mailbox=None, seconds=10.0, frames=100):
        self.tracker, self.outcomes = Recorder(), []
        self.changed = threading.Condition()
        self.worker = TrackerWorker(
            self.tracker, self._deliver, mailbox=mailbox or LatestMailbox(),
            history=FrameHistory(seconds, frames))
        self.worker.start()

    def _deliver(self, outcome):
        with self.changed:
            self.outcomes.append(outcome)
            self.changed.notify_all()

    def frame(self, number, received=None):
        """Submit the frame whose pixels and stamp in seconds are `number`."""
        frame = Frame(np.full((2, 2), number), int(number * SECOND),
                      time.monotonic() if received is None else received)
        self.worker.submit(frame)

    def wait(self, count):
        """Wait for so many outcomes in total and return the last."""
        with self.changed:
            assert self.changed.wait_for(lambda: len(self.outcomes) >= count, PATIENCE)
            return self.outcomes[-1]

    def wait_for(self, matches):
        """Wait for an outcome that matches and return it."""
        with self.changed:
            assert self.changed.wait_for(lambda: any(map(matches, self.outcomes)), PATIENCE)
            return next(filter(matches, self.outcomes))

    def hold(self):
        """Let the tracker get stuck in the next frame."""
        self.tracker.gate.clear()
        self.tracker.entered.clear()

    def stuck(self):
        assert self.tracker.entered.wait(PATIENCE)


@pytest.fixture
def bench():
    benches = []

    def make(*args, **kwargs):
        benches.append(Bench(*args, **kwargs))
        return benches[-1]
    yield make
    for each in benches:
        each.tracker.gate.set()
        each.worker.stop()


def test_core_of_the_node_runs_without_ros():
    check = ('import sys; import lmsco_ros.node.worker; '
             'sys.exit(any(name.split(".")[0] == "rclpy" for name in sys.modules))')
    done = subprocess.run([sys.executable, '-c', check], cwd=REPOSITORY, timeout=60)
    assert done.returncode == 0


def test_outcome_tells_frame_times_and_context(bench):
    b = bench()
    b.worker.initialize(BOX)
    received = time.monotonic() - 5
    b.worker.submit(Frame(np.zeros((2, 2)), 0, received, 'context'))
    outcome = b.wait(1)
    assert (outcome.phase, outcome.live, outcome.track_id) == (Phase.TRACKED, True, 1)
    assert outcome.frame.context == 'context'
    assert outcome.started - outcome.frame.received >= 5
    assert outcome.started <= outcome.finished <= time.monotonic()


def test_latest_drops_what_a_busy_tracker_cannot_take(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    for number in range(1, 6):
        b.frame(number)
    b.tracker.gate.set()
    b.wait(2)
    assert b.tracker.calls == [('initialize', 0), ('update', 5)]
    assert b.worker.dropped_frames == 4


def test_all_makes_the_sender_wait_and_loses_nothing(bench):
    b = bench(BoundedMailbox(2))
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    sender = threading.Thread(target=lambda: [b.frame(number) for number in range(1, 8)])
    sender.start()
    sender.join(0.1)
    assert sender.is_alive()
    b.tracker.gate.set()
    b.wait(8)
    sender.join(PATIENCE)
    assert [number for _, number in b.tracker.calls] == list(range(8))
    assert b.worker.dropped_frames == 0


def test_stop_releases_a_waiting_sender(bench):
    b = bench(BoundedMailbox(1))
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    sender = threading.Thread(target=lambda: [b.frame(number) for number in range(1, 4)])
    sender.start()
    assert not b.worker.stop(timeout=0.05)
    sender.join(PATIENCE)
    assert not sender.is_alive()


def test_nothing_is_delivered_after_stop(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    assert not b.worker.stop(timeout=0.05)
    b.tracker.gate.set()
    assert b.worker.stop(timeout=PATIENCE)
    assert not b.outcomes


def test_stop_before_start_and_twice():
    worker = TrackerWorker(Recorder(), print, mailbox=LatestMailbox(),
                           history=FrameHistory(1.0, 1))
    assert worker.stop() and worker.stop()


@pytest.mark.parametrize('mailbox', [LatestMailbox(), BoundedMailbox(50)])
def test_commands_keep_their_place_between_frames(bench, mailbox):
    b = bench(mailbox)
    b.frame(1)
    b.wait(1)
    b.worker.initialize(BOX)
    b.wait(2)
    b.frame(2)
    b.wait(3)
    b.worker.reset()
    b.frame(3)
    b.wait(4)
    b.worker.set_enabled(False)
    b.frame(4)
    b.wait(5)
    b.worker.set_enabled(True)
    b.frame(5)
    b.wait(6)
    assert [o.phase for o in b.outcomes] == [
        Phase.IDLE, Phase.TRACKED, Phase.TRACKED, Phase.IDLE, Phase.DISABLED, Phase.IDLE]
    assert [o.live for o in b.outcomes] == [True, False, True, True, True, True]


def test_init_starts_on_the_frame_that_was_newest_when_it_came(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    b.frame(1)
    b.worker.initialize(BOX)
    b.frame(2)
    b.tracker.gate.set()
    b.wait(3)
    # Frame 1 was dropped for frame 2 as a frame to track, not as the one to start on.
    assert b.tracker.calls == [('initialize', 0), ('initialize', 1), ('update', 2)]
    assert [o.track_id for o in b.outcomes] == [1, 2, 2]


def test_flood_of_starts_does_not_build_up(bench):
    b = bench()
    for number in range(5):
        b.frame(number)
    b.wait(1)
    b.worker.initialize(BOX, 4 * SECOND)
    b.wait(2)
    before = len(b.outcomes)
    b.hold()
    b.frame(5)
    b.stuck()
    for _ in range(10):
        b.worker.initialize(BOX, 2 * SECOND)
    b.tracker.gate.set()
    b.wait(before + 1 + 4)
    b.frame(6)
    b.wait(before + 1 + 4 + 1)
    assert b.tracker.calls[-5:] == [
        ('initialize', 2), ('update', 3), ('update', 4), ('update', 5), ('update', 6)]


def test_error_costs_the_target_only(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.frame(0)
    b.wait(1)
    b.tracker.error = MemoryError('too big')
    b.frame(1)
    outcome = b.wait(2)
    assert (outcome.phase, outcome.result) == (Phase.FAILED, None)
    assert outcome.error == 'MemoryError: too big'
    b.frame(2)
    assert b.wait(3).phase is Phase.IDLE
    b.worker.initialize(BOX)
    assert b.wait(4).phase is Phase.TRACKED


def test_request_for_a_missed_frame_is_refused(bench):
    b = bench()
    b.frame(1)
    b.wait(1)
    b.worker.initialize(BOX, 2 * SECOND)
    b.frame(3)
    b.wait(3)
    assert sorted(o.phase.value for o in b.outcomes) == ['idle', 'idle', 'refused']
    assert 'no frame with the stamp 2.0' in next(o.error for o in b.outcomes if o.error)


def test_request_for_a_frame_that_never_comes_expires(bench):
    b = bench(seconds=3.0)
    b.worker.initialize(BOX, 10 ** 6 * SECOND)
    b.frame(1)
    assert b.wait(1).phase is Phase.IDLE
    b.frame(2, received=time.monotonic() + 3.5)
    b.wait(3)
    assert Phase.REFUSED in [o.phase for o in b.outcomes]


def test_refusal_names_the_range_of_frames_that_are_kept(bench):
    b = bench(seconds=3.0)
    for number in range(10):
        b.frame(number)
    b.worker.initialize(BOX, 5 * SECOND)
    refused = b.wait_for(lambda outcome: outcome.phase is Phase.REFUSED)
    assert '4 from 6.000000000 to 9.000000000' in refused.error


def test_start_in_the_past_goes_through_what_comes_meanwhile(bench):
    b = bench()
    for number in range(4):
        b.frame(number)
    b.wait(1)
    before = len(b.outcomes)
    b.hold()
    b.worker.initialize(BOX, SECOND)
    b.stuck()
    for number in range(4, 20):
        b.frame(number)
    b.tracker.gate.set()
    b.wait(before + 19)
    assert b.tracker.calls[-19:] == [('initialize', 1)] + [
        ('update', number) for number in range(2, 20)]


def test_start_in_the_past_catches_up_in_a_bounded_number_of_steps(bench):
    b = bench(frames=5)
    for number in range(9):
        b.frame(number)
    b.wait(1)
    b.hold()
    b.worker.initialize(BOX, 4 * SECOND)
    b.stuck()
    for number in range(9, 100):
        b.frame(number)
    b.tracker.gate.set()
    b.wait_for(lambda outcome: outcome.frame.stamp == 99 * SECOND)
    updates = [number for _, number in b.tracker.calls[1:]]
    # Four that were kept, five that came meanwhile, then the newest.
    assert updates == [5, 6, 7, 8, 9, 10, 11, 12, 13, 99]


def test_refusals_do_not_pile_up_behind_a_busy_tracker(bench):
    b = bench()
    b.frame(5)
    b.wait(1)
    b.worker.initialize(BOX)
    b.wait(2)
    b.hold()
    b.frame(6)
    b.stuck()
    for _ in range(1000):
        b.worker.initialize(BOX, SECOND)
    assert len(b.worker._mailbox._items) == 1
    b.tracker.gate.set()
    assert b.wait(4).phase is Phase.REFUSED


def test_commands_wait_for_room_where_all_is_kept(bench):
    b = bench(BoundedMailbox(2))
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    sender = threading.Thread(target=lambda: [b.worker.reset() for _ in range(50)])
    sender.start()
    sender.join(0.1)
    assert sender.is_alive() and len(b.worker._mailbox._items) == 2
    b.tracker.gate.set()
    sender.join(PATIENCE)
    assert not sender.is_alive()


def test_time_with_one_frame_is_told(bench):
    b = bench()
    assert b.worker.busy_seconds == 0
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    first = b.worker.busy_seconds
    assert 0 <= first <= b.worker.busy_seconds
    b.tracker.gate.set()
    b.wait(1)
    b.worker.stop(PATIENCE)
    assert b.worker.busy_seconds == 0


def test_refused_request_keeps_the_target(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.frame(5)
    b.wait(1)
    b.worker.initialize(BOX, 1 * SECOND)
    assert b.wait(2).phase is Phase.REFUSED
    b.frame(6)
    assert b.wait(3).phase is Phase.TRACKED


STAMPS = st.lists(st.integers(0, 30), min_size=1, max_size=30)


@given(STAMPS, st.integers(1, 10), st.integers(0, 10))
def test_history_is_ordered_and_bounded(stamps, frames, seconds):
    history = FrameHistory(seconds, frames)
    for stamp in stamps:
        history.add(Frame(np.zeros((1, 1)), stamp * SECOND, 0.0))
        kept = [frame.stamp // SECOND for frame in history]
        assert kept[-1] == stamp and kept == sorted(kept)
        assert len(kept) <= frames and kept[0] >= stamp - seconds


@given(STAMPS)
def test_history_finds_the_frame_and_all_later_ones(stamps):
    history = FrameHistory(100, 100)
    for stamp in sorted(stamps):
        history.add(Frame(np.zeros((1, 1)), stamp, 0.0))
    for stamp in range(32):
        expected = [s for s in sorted(stamps) if s >= stamp] if stamp in stamps else []
        assert [frame.stamp for frame in history.since(stamp)] == expected


@given(st.lists(st.booleans(), max_size=30))
def test_latest_mailbox_keeps_all_commands_and_one_frame(kinds):
    mailbox, dropped = LatestMailbox(), 0
    for number, is_frame in enumerate(kinds):
        if is_frame:
            dropped += mailbox.put_frame((number,))
        else:
            mailbox.put((number,))
    frames = [number for number, is_frame in enumerate(kinds) if is_frame]
    expected = sorted([number for number, is_frame in enumerate(kinds) if not is_frame]
                      + frames[-1:])
    assert [mailbox.take()[0] for _ in expected] == expected
    assert dropped == max(len(frames) - 1, 0)
    mailbox.close()
    assert mailbox.take() is None
