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

from dataclasses import replace
from pathlib import Path
import re
import subprocess
import sys
import threading
import time
import weakref

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.followed_targets import FollowedTargets
from lmsco_ros.node.history import FrameHistory
from lmsco_ros.node.mailbox import BoundedMailbox, LatestMailbox
from lmsco_ros.node.outcome import PendingFrame, Phase
from lmsco_ros.node.worker import TrackerWorker

REPOSITORY = Path(__file__).resolve().parents[2]
PATIENCE = 100.0
BOX = BoundingBox(1, 2, 3, 4)
SECOND = 10 ** 9


class Pixels:
    """An image that is read without ROS, and counts how often."""

    def __init__(self, image, error=None):
        self.image, self.error, self.reads = image, error, 0
        self.nbytes = image.nbytes

    def read(self):
        self.reads += 1
        if self.error is not None:
            raise self.error
        return self.image


class Recorder:
    """A tracker that notes its calls, and holds them while the gate is closed."""

    def __init__(self):
        self.calls, self.times, self.error = [], [], None
        self.on_learn = lambda: None
        self.results, self.count, self.state = {}, 0, TrackState.TRACKING
        self.gate = threading.Event()
        self.gate.set()
        self.entered = threading.Event()

    def initialize(self, image, box, time, in_place_of=()):
        self.times.append(time)
        self._answer('initialize', image)
        for number in in_place_of:
            self.drop(number)
        self.count += 1
        self.results[self.count] = self._result(box)
        return self.count

    def update(self, image, time, only=None):
        self.times.append(time)
        self._answer('update', image)
        return {number: self._result(result.box) for number, result in self.results.items()
                if only is None or number in only}

    def learn(self):
        self.on_learn()

    def drop(self, number):
        del self.results[number]

    def reset(self):
        self.results = {}

    def _answer(self, call, image):
        self.calls.append((call, int(image[0, 0])))
        self.entered.set()
        assert self.gate.wait(PATIENCE)
        error, self.error = self.error, None
        if error:
            raise error

    def _result(self, box):
        return TrackResult(box, 1.0, self.state, np.zeros((2, 2), np.float32), box)


class Bench:
    """A worker, its tracker and what it delivered."""

    def __init__(self, mailbox=None, seconds=10.0, frames=100, nbytes=10 ** 6, **targets):
        self.tracker, self.outcomes, self.faults = Recorder(), [], []
        self.changed = threading.Condition()
        self.worker = TrackerWorker(
            FollowedTargets(self.tracker, **targets), self._deliver,
            mailbox=LatestMailbox() if mailbox is None else mailbox,
            history=FrameHistory(seconds, frames, nbytes),
            on_fault=lambda work, error: self.faults.append((work, error)))
        self.worker.start()

    def _deliver(self, outcome):
        with self.changed:
            self.outcomes.append(outcome)
            self.changed.notify_all()

    def frame(self, number, received=None, error=None):
        """Submit the frame whose pixels and stamp in seconds are `number`."""
        pixels = Pixels(np.full((2, 2), number), error)
        self.worker.submit(PendingFrame(pixels, int(number * SECOND),
                                        time.monotonic() if received is None else received))
        return pixels

    def frames(self, numbers):
        """Submit frames, and wait until the last of them is answered."""
        for number in numbers:
            self.frame(number)
        self.wait_for(lambda outcome: outcome.frame.stamp == numbers[-1] * SECOND)

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
    done = subprocess.run([sys.executable, '-c', check], cwd=REPOSITORY, timeout=PATIENCE)
    assert done.returncode == 0


def test_outcome_tells_frame_times_and_context(bench):
    b = bench()
    b.worker.initialize(BOX)
    received = time.monotonic() - 5
    b.worker.submit(PendingFrame(Pixels(np.zeros((2, 2))), 0, received, 'context'))
    outcome = b.wait(1)
    assert (outcome.phase, outcome.live, outcome.track_id) == (Phase.TRACKED, True, 1)
    assert outcome.frame.context == 'context'
    assert outcome.started - outcome.frame.received >= 5
    assert outcome.started <= outcome.finished <= time.monotonic()


def test_answer_goes_out_before_it_is_learned_from(bench):
    b, answered = bench(), []
    b.tracker.on_learn = lambda: answered.append(len(b.outcomes))
    b.worker.initialize(BOX)
    b.frames([0])
    b.frames([1])
    b.worker.reset()
    b.frames([2])
    b.worker.stop()
    # Where nothing was tracked there is nothing to learn from.
    assert answered == [1, 2]


def test_failure_to_learn_is_told_and_leaves_the_answers(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.frames([0])
    b.tracker.on_learn = lambda: 1 / 0
    b.frames([1])
    b.tracker.on_learn = lambda: None
    b.frames([2])
    assert [outcome.phase for outcome in b.outcomes] == 3 * [Phase.TRACKED]
    (work, error), = b.faults
    assert isinstance(error, ZeroDivisionError)


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


def test_all_says_when_to_hold_back_and_loses_nothing(bench):
    room = threading.Semaphore(0)
    b = bench(BoundedMailbox(2, room.release))
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    assert b.worker.has_room()
    b.frame(1)
    b.frame(2)
    assert not b.worker.has_room()
    # Whoever does not ask is not held up either, and nothing is lost.
    b.frame(3)
    b.tracker.gate.set()
    assert room.acquire(timeout=PATIENCE) and b.worker.has_room()
    for number in range(4, 8):
        b.frame(number)
    b.wait(8)
    assert [number for _, number in b.tracker.calls] == list(range(8))
    assert b.worker.dropped_frames == 0


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


def test_stop_frees_the_images(bench):
    b = bench(BoundedMailbox(50, int))
    b.hold()
    b.worker.initialize(BOX)
    b.frame(0)
    b.stuck()
    waiting = weakref.ref(b.frame(1))
    assert waiting() is not None
    b.worker.stop(timeout=0.05)
    assert waiting() is None


def test_stop_before_start_and_twice():
    worker = TrackerWorker(FollowedTargets(Recorder()), print, mailbox=LatestMailbox(),
                           on_fault=print, history=FrameHistory(1.0, 1, 1))
    assert worker.stop() and worker.stop()


@pytest.mark.parametrize('mailbox', [LatestMailbox(), BoundedMailbox(50, int)])
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
    b.frames(range(5))
    b.worker.initialize(BOX, 4 * SECOND)
    b.wait_for(lambda outcome: outcome.phase is Phase.TRACKED)
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


def test_request_for_a_frame_that_is_gone_tells_how_much_too_old_it_is(bench):
    b = bench()
    b.frame(8)
    b.wait(1)
    b.worker.initialize(BOX, 5 * SECOND)
    b.frame(9)
    b.wait(3)
    reason = next(o.error for o in b.outcomes if o.error)
    assert re.search(r'stamp 5\.0+ is kept: it is \d+\.\d s too old', reason)
    assert 'frame_history_seconds' in reason


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
    b.frames(range(4))
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
    b.frames(range(9))
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
    assert len(b.worker._mailbox) == 1
    b.tracker.gate.set()
    assert b.wait(4).phase is Phase.REFUSED


@pytest.mark.parametrize('mailbox', [LatestMailbox(), BoundedMailbox(2, int)])
def test_flood_of_requests_neither_waits_nor_piles_up(bench, mailbox):
    b = bench(mailbox)
    for number in range(3):
        b.frame(number)
        b.wait(number + 1)
    b.worker.initialize(BOX)
    b.wait(4)
    b.hold()
    b.frame(3)
    b.stuck()
    for _ in range(300):
        b.worker.reset()
        b.worker.set_enabled(False)
        b.worker.initialize(BOX, SECOND)
        b.worker.set_enabled(True)
        b.worker.initialize(BOX)
        b.worker.initialize(BOX, 0)
    # A start and the three frames behind it.
    assert len(mailbox) == 4
    b.tracker.gate.set()
    b.wait(5 + 4)
    assert [number for _, number in b.tracker.calls[-4:]] == [0, 1, 2, 3]


def test_flood_of_starts_on_coming_frames_does_not_pile_up(bench):
    mailbox = LatestMailbox()
    b = bench(mailbox)
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    for number in range(1, 100):
        b.worker.initialize(BOX, number * SECOND)
        b.frame(number)
    assert len(mailbox) == 1 and b.worker.dropped_frames == 98
    b.tracker.gate.set()
    b.wait(2)
    assert b.tracker.calls[-1] == ('initialize', 99)


@pytest.mark.parametrize('mailbox', [LatestMailbox(), BoundedMailbox(50, int)])
def test_reset_supersedes_a_catch_up(bench, mailbox):
    b = bench(mailbox)
    for number in range(5):
        b.frame(number)
        b.wait(number + 1)
    b.hold()
    b.worker.initialize(BOX, 0)
    b.stuck()
    b.frame(5)
    b.worker.reset()
    b.frame(6)
    b.tracker.gate.set()
    outcome = b.wait_for(lambda outcome: outcome.frame.stamp == 6 * SECOND)
    assert outcome.phase is Phase.IDLE
    assert b.tracker.calls == [('initialize', 0)]


def test_reset_answers_what_waits_without_a_target(bench):
    b = bench(BoundedMailbox(50, int))
    b.worker.initialize(BOX)
    b.hold()
    b.frame(0)
    b.stuck()
    b.frame(1)
    b.worker.initialize(BOX, 2 * SECOND)
    b.frame(2)
    b.frame(3)
    b.worker.reset()
    b.worker.initialize(BOX, 4 * SECOND)
    b.frame(4)
    b.tracker.gate.set()
    b.wait(5)
    assert [o.phase for o in b.outcomes] == [
        Phase.TRACKED, Phase.IDLE, Phase.IDLE, Phase.IDLE, Phase.TRACKED]
    assert b.outcomes[-1].track_id == 2


def test_start_keeps_its_place_before_the_frames_that_came_later(bench):
    b = bench(BoundedMailbox(50, int))
    b.frame(0)
    b.wait(1)
    b.worker.initialize(BOX)
    b.wait(2)
    b.hold()
    b.frame(1)
    b.stuck()
    b.worker.initialize(BOX)
    b.frame(2)
    b.worker.initialize(BOX)
    b.tracker.gate.set()
    b.wait(6)
    assert [o.track_id for o in b.outcomes] == [0, 1, 1, 2, 2, 3]


def test_images_are_read_by_the_thread_and_only_those_that_are_needed(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.hold()
    first = b.frame(0)
    b.stuck()
    dropped, last = b.frame(1), b.frame(2)
    b.tracker.gate.set()
    b.wait(2)
    assert (first.reads, dropped.reads, last.reads) == (1, 0, 1)
    assert (b.outcomes[-1].image == 2).all()


@pytest.mark.parametrize('error', [ImageError('cut off'), MemoryError('too big')])
def test_unreadable_image_costs_that_image_only(bench, error):
    b = bench()
    b.worker.initialize(BOX)
    b.frame(0)
    b.wait(1)
    b.frame(1, error=error)
    outcome = b.wait(2)
    assert outcome.phase is Phase.REFUSED and str(error) in outcome.error
    assert outcome.image is None and not b.faults
    b.frame(2)
    assert (b.wait(3).phase, b.wait(3).track_id) == (Phase.TRACKED, 1)
    # The newest image that can be read is the one to start on.
    b.frame(3, error=error)
    b.wait(4)
    b.worker.initialize(BOX)
    assert (b.wait(5).phase, b.wait(5).image[0, 0]) == (Phase.TRACKED, 2)


def test_start_waits_for_an_image_that_can_be_read(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.frame(0, error=ImageError('cut off'))
    assert b.wait(1).phase is Phase.REFUSED
    b.frame(1)
    assert (b.wait(2).phase, b.wait(2).track_id) == (Phase.TRACKED, 1)
    b.worker.initialize(BOX, 2 * SECOND)
    b.frame(2, error=ImageError('cut off'))
    assert b.wait(3).phase is Phase.REFUSED
    # It was to start on that frame; another one shows the target elsewhere.
    b.frame(3)
    assert (b.wait(4).phase, b.wait(4).track_id) == (Phase.TRACKED, 1)


def test_start_that_waits_is_forgotten_by_a_reset_while_its_image_is_read(bench):
    b = bench()
    reset = Pixels(np.zeros((2, 2)), ImageError('cut off'))
    reset.read = lambda read=reset.read: (b.worker.reset(), read())
    b.worker.initialize(BOX)
    b.worker.submit(PendingFrame(reset, 0, time.monotonic()))
    b.wait(1)
    b.frame(1)
    assert b.wait(2).phase is Phase.IDLE


def test_reset_while_an_image_is_read_holds_for_that_image(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.frames([0])
    reset = Pixels(np.ones((2, 3)))
    reset.read = lambda read=reset.read: (b.worker.reset(), read())[1]
    b.worker.submit(PendingFrame(reset, SECOND, time.monotonic()))
    assert b.wait(2).phase is Phase.IDLE and b.worker.image_size == (3, 2)
    assert b.tracker.calls == [('initialize', 0)]


@pytest.mark.parametrize('error', [MemoryError(), SystemExit(3), RuntimeError('no publisher')])
def test_thread_survives_whatever_delivering_raises(bench, error):
    b = bench()
    deliver, failing = b.worker._deliver, [error]

    def fail_once(outcome):
        if failing:
            raise failing.pop()
        deliver(outcome)
    b.worker._deliver = fail_once
    b.frame(0)
    b.frame(1)
    b.worker.initialize(BOX)
    b.wait_for(lambda outcome: outcome.phase is Phase.TRACKED)
    assert b.faults == [('answering an image', error)]


def test_catch_up_is_bounded_in_bytes(bench):
    size = np.full((2, 2), 0).nbytes
    b = bench(nbytes=3 * size)
    b.frames(range(9))
    b.hold()
    b.worker.initialize(BOX, 6 * SECOND)
    b.stuck()
    for number in range(9, 30):
        b.frame(number)
    b.tracker.gate.set()
    b.wait_for(lambda outcome: outcome.frame.stamp == 29 * SECOND)
    assert [number for _, number in b.tracker.calls[1:]] == [7, 8, 9, 10, 11, 29]


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


def test_tracker_is_told_when_frames_were_taken(bench):
    b = bench()
    b.frames([1])
    b.worker.initialize(BOX)
    b.frames([2])
    b.frames([3])
    assert b.tracker.times == pytest.approx([1.0, 2.0, 3.0])


def test_refused_request_keeps_the_target(bench):
    b = bench()
    b.worker.initialize(BOX)
    b.frame(5)
    b.wait(1)
    b.worker.initialize(BOX, 1 * SECOND)
    assert b.wait(2).phase is Phase.REFUSED
    b.frame(6)
    assert b.wait(3).phase is Phase.TRACKED


def boxes(outcome):
    """Return where the targets of an outcome are, by their numbers."""
    return {number: result.box.x for number, result in outcome.results.items()}


def at(x):
    """Return a box."""
    return BoundingBox(x, 2, 3, 4)


def test_several_targets_are_started_and_followed_together(bench):
    b = bench(most=3)
    for x in (1, 2, 3):
        b.worker.initialize(at(x))
    b.frame(0)
    b.wait(3)
    # The first answers the frame; the others start on the same one, behind it.
    assert [(o.live, boxes(o), o.track_id, o.start.number) for o in b.outcomes] == [
        (True, {1: 1}, 1, 1), (False, {2: 2}, 2, 2), (False, {3: 3}, 3, 3)]
    b.frame(1)
    outcome = b.wait(4)
    assert boxes(outcome) == {1: 1, 2: 2, 3: 3} and outcome.start is None
    assert b.tracker.calls == [('initialize', 0)] * 3 + [('update', 1)]
    assert tuple(b.worker.results) == (1, 2, 3)


def test_start_on_a_coming_frame_leaves_it_to_the_others_as_well(bench):
    b = bench(most=2)
    b.worker.initialize(at(1))
    b.frame(0)
    b.wait(1)
    b.worker.initialize(at(2), SECOND)
    b.frame(1)
    outcome = b.wait(2)
    assert (outcome.live, boxes(outcome), outcome.track_id) == (True, {1: 1, 2: 2}, 2)
    assert b.tracker.calls[1:] == [('update', 1), ('initialize', 1)]


def test_start_beyond_the_most_takes_the_place_of_the_selected_one(bench):
    b = bench(most=2)
    for number, x in enumerate((1, 2, 3)):
        b.worker.initialize(at(x))
        b.frame(number)
        b.wait_for(lambda outcome: outcome.frame.stamp == number * SECOND)
    b.wait_for(lambda outcome: outcome.start and outcome.start.number == 3)
    assert tuple(b.worker.results) == (1, 3)
    b.worker.select(1)
    b.worker.initialize(at(4))
    started = b.wait_for(lambda outcome: outcome.start and outcome.start.number == 4)
    assert started.start.replaced == (1,) and tuple(b.worker.results) == (3, 4)
    b.frame(9)
    outcome = b.wait_for(lambda outcome: outcome.frame.stamp == 9 * SECOND)
    # The latest is selected again.
    assert boxes(outcome) == {3: 3, 4: 4} and outcome.track_id == 4


def test_start_beyond_the_most_takes_the_place_of_the_one_lost_longest(bench):
    b = bench(most=3)
    for x in (1, 2, 3):
        b.worker.initialize(at(x))
    b.frame(0)
    b.wait(3)
    states = {1: TrackState.TRACKING, 2: TrackState.TRACKING, 3: TrackState.LOST}
    update = b.tracker.update
    b.tracker.update = lambda image, time, only=None: {
        number: replace(result, state=states[number])
        for number, result in update(image, time, only).items()}
    b.frame(1)
    b.wait(4)
    states[2] = TrackState.LOST
    b.frame(2)
    b.wait(5)
    b.worker.select(1)
    b.worker.initialize(at(4))
    assert b.wait(6).start.replaced == (3,)


def test_offer_that_is_not_wanted_any_more_is_a_plain_frame(bench):
    b = bench(most=2)
    b.worker.initialize(at(1))
    b.frame(0)
    b.wait(1)
    asked = []
    b.worker.offer(at(2), SECOND, lambda results: asked.append(dict(results)))
    b.frame(1)
    assert boxes(b.wait(2)) == {1: 1} and b.wait(2).start is None
    b.worker.offer(at(2), None, lambda results: asked.append(dict(results)))
    b.frame(2)
    assert boxes(b.wait(3)) == {1: 1} and len(b.outcomes) == 3
    assert [set(results) for results in asked] == [{1}, {1}]
    b.worker.offer(at(2), None, lambda results: True)
    assert b.wait(4).start.accepted


def test_selected_target_is_the_one_that_an_outcome_speaks_of(bench):
    b = bench(most=3)
    for x in (1, 2, 3):
        b.worker.initialize(at(x))
    b.frame(0)
    b.wait(3)
    b.worker.select(2)
    b.frame(1)
    assert (b.wait(4).track_id, b.wait(4).result.box.x) == (2, 2)
    assert b.worker.track_id == 2


def test_refused_start_leaves_the_others_as_they_are(bench):
    b = bench(most=2)
    b.worker.initialize(at(1))
    b.frame(0)
    b.wait(1)
    b.worker.initialize(at(2), SECOND)
    initialize = b.tracker.initialize

    def refuse(image, box, time, in_place_of):
        b.tracker.initialize = initialize
        raise ImageError('nothing to see')
    b.tracker.initialize = refuse
    b.frame(1)
    outcome = b.wait(2)
    assert (outcome.phase, boxes(outcome), outcome.track_id) == (Phase.TRACKED, {1: 1}, 1)
    assert not outcome.start.accepted and outcome.start.reason == outcome.error
    assert outcome.error == 'nothing to see' and outcome.refused
    b.frame(2)
    assert boxes(b.wait(3)) == {1: 1}


def test_late_target_catches_up_alone(bench):
    b = bench(most=2)
    b.worker.initialize(at(1))
    b.frames(range(5))
    before = len(b.outcomes)
    b.worker.initialize(at(2), 2 * SECOND)
    b.wait(before + 3)
    late = b.outcomes[before:]
    assert [(o.live, o.frame.stamp // SECOND, boxes(o), o.track_id) for o in late] == [
        (False, 2, {2: 2}, 2), (False, 3, {2: 2}, 2), (False, 4, {2: 2}, 2)]
    b.frame(5)
    assert boxes(b.wait(before + 4)) == {1: 1, 2: 2}


def test_refused_late_start_does_not_let_the_others_go_through_old_frames(bench):
    b = bench(most=2)
    b.worker.initialize(at(1))
    b.frames(range(5))
    before, calls = len(b.outcomes), len(b.tracker.calls)
    b.tracker.error = ImageError('nothing to see')
    b.worker.initialize(at(2), 2 * SECOND)
    assert b.wait(before + 1).error == 'nothing to see'
    b.frame(5)
    b.wait(before + 2)
    assert b.tracker.calls[calls:] == [('initialize', 2), ('update', 5)]


def test_late_target_that_is_replaced_does_not_go_on_catching_up(bench):
    b = bench(BoundedMailbox(50, int))
    b.frames(range(5))
    b.hold()
    b.worker.initialize(at(1), 2 * SECOND)
    b.stuck()
    b.frame(5)
    b.worker.initialize(at(2))
    b.tracker.gate.set()
    b.frame(6)
    outcome = b.wait_for(lambda outcome: outcome.frame.stamp == 6 * SECOND)
    assert boxes(outcome) == {2: 2}


def test_late_target_that_is_dropped_goes_through_no_more_frames(bench):
    b = bench(most=2, drop_after=1.5)
    b.worker.initialize(at(1))
    b.frames(range(8))
    before = len(b.outcomes)
    b.tracker.state = TrackState.LOST
    b.worker.initialize(at(2), 2 * SECOND)
    assert b.wait(before + 3).dropped == (2,)
    b.tracker.state = TrackState.TRACKING
    b.frames([8])
    assert [outcome.frame.stamp // SECOND for outcome in b.outcomes[before:]] == [2, 3, 4, 8]


def test_outcome_of_a_late_target_speaks_of_it_whichever_is_selected(bench):
    b = bench(most=2)
    b.worker.initialize(at(1))
    b.frames(range(5))
    before = len(b.outcomes)
    b.tracker.on_learn = lambda: b.worker.select(1)
    b.worker.initialize(at(2), 2 * SECOND)
    b.wait(before + 3)
    assert b.worker.track_id == 1
    assert [outcome.track_id for outcome in b.outcomes[before:]] == [2, 2, 2]


def test_waiting_starts_are_as_many_as_there_may_be_targets(bench):
    mailbox = LatestMailbox()
    b = bench(mailbox, most=3)
    b.frame(0)
    b.wait(1)
    b.worker.initialize(at(0))
    b.hold()
    b.frame(1)
    b.stuck()
    for x in range(1, 100):
        b.worker.initialize(at(x))
        b.worker.initialize(at(x), 90 * SECOND)
    assert len(mailbox) <= 3
    b.frame(90)
    b.tracker.gate.set()
    b.wait_for(lambda outcome: outcome.start and outcome.start.number == b.tracker.count
               and outcome.frame.stamp == 90 * SECOND)
    assert b.tracker.count <= 5


@pytest.mark.parametrize('drop_after, left', [(2.0, ()), (9.0, (1, 2)), (0.0, (1, 2))])
def test_target_that_is_lost_for_too_long_is_dropped(bench, drop_after, left):
    b = bench(most=2, drop_after=drop_after)
    b.worker.initialize(at(1))
    b.worker.initialize(at(2))
    b.frames([0])
    b.wait(2)
    b.tracker.state = TrackState.LOST
    for number in (1, 2, 3, 4):
        b.frame(number)
        outcome = b.wait(number + 2)
        assert boxes(outcome) == {1: 1, 2: 2}
    # Lost since 1 s, and at 4 s for more than two seconds.
    assert outcome.dropped == tuple(sorted({1, 2} - set(left)))
    assert tuple(b.worker.results) == left and set(b.tracker.results) == set(left)
    b.frame(5)
    assert b.wait(7).phase is (Phase.TRACKED if left else Phase.IDLE)


def test_target_that_was_found_again_is_lost_anew(bench):
    b = bench(drop_after=2.0)
    b.worker.initialize(at(1))
    b.frame(0)
    b.wait(1)
    for number, state in enumerate((TrackState.LOST, TrackState.LOST, TrackState.UNCERTAIN,
                                    TrackState.LOST, TrackState.LOST, TrackState.LOST), 1):
        b.tracker.state = state
        b.frame(number)
        assert b.wait(number + 1).dropped == ()
    b.frame(7)
    assert b.wait(8).dropped == (1,)


def test_time_that_begins_anew_drops_nothing_at_once(bench):
    b = bench(drop_after=2.0)
    b.worker.initialize(at(1))
    b.frame(100)
    b.wait(1)
    b.tracker.state = TrackState.LOST
    for count, number in enumerate((101, 1, 2, 3)):
        b.frame(number)
        assert b.wait(count + 2).dropped == ()
    b.frame(4)
    assert b.wait(6).dropped == (1,)


def test_new_worker_begins_without_the_targets_of_the_one_before(bench):
    tracker = Recorder()
    tracker.initialize(np.zeros((2, 2), int), BOX, 0.0)
    b = bench()
    b.worker._targets._tracker = tracker
    b.frame(0)
    assert b.wait(1).phase is Phase.IDLE and not tracker.results


STAMPS = st.lists(st.integers(0, 30), min_size=1, max_size=30)


@given(STAMPS, st.integers(1, 10), st.integers(0, 10))
def test_history_is_ordered_and_bounded(stamps, frames, seconds):
    history = FrameHistory(seconds, frames, 10 ** 6)
    for stamp in stamps:
        history.add(PendingFrame(Pixels(np.zeros((1, 1))), stamp * SECOND, 0.0))
        kept = [frame.stamp // SECOND for frame in history]
        assert kept[-1] == stamp and kept == sorted(kept)
        assert len(kept) <= frames and kept[0] >= stamp - seconds


@given(st.lists(st.integers(1, 50), min_size=1, max_size=30), st.integers(1, 100))
def test_history_is_bounded_in_bytes_and_keeps_the_newest(sizes, nbytes):
    history = FrameHistory(100, 100, nbytes)
    for stamp, size in enumerate(sizes):
        history.add(PendingFrame(Pixels(np.zeros(size, np.uint8)), stamp, 0.0))
        assert history.last.stamp == stamp
        assert len(history) == 1 or sum(frame.nbytes for frame in history) <= nbytes
    kept = [frame.nbytes for frame in history]
    # No more were forgotten than had to be.
    assert kept == sizes or sum(sizes[-len(kept) - 1:]) > nbytes


def test_history_forgets_a_frame_with_its_bytes():
    history = FrameHistory(100, 100, 20)
    frames = [PendingFrame(Pixels(np.zeros(10, np.uint8)), stamp, 0.0) for stamp in range(3)]
    for frame in frames[:2]:
        history.add(frame)
    history.discard(frames[1])
    history.discard(frames[2])
    history.add(frames[2])
    assert list(history) == [frames[0], frames[2]]


@given(STAMPS)
def test_history_finds_the_frame_and_all_later_ones(stamps):
    history = FrameHistory(100, 100, 10 ** 6)
    for stamp in sorted(stamps):
        history.add(PendingFrame(Pixels(np.zeros((1, 1))), stamp, 0.0))
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
