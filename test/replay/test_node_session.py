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

"""The real node with a tracker that does as told: pace, order, refusals."""

from functools import partial
import threading
import time

import numpy as np
import pytest
from std_msgs.msg import Header

from lmsco_ros.core.errors import BoxError
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.tracker_node import TrackerNode
from lmsco_ros.replay.errors import NodeError
from lmsco_ros.replay.node_session import NodeSession
from lmsco_ros.replay.player import Player
from msg_adapters.image import message_from_image

START = BoundingBox(5, 6, 10, 12)
SECOND = 1_000_000_000


class Follower:
    """Says the brightness of the image's first pixel as x; counts what it saw."""

    def __init__(self, gate=None):
        self.seen, self.results = [], {}
        self.gate = gate

    def initialize(self, image, box, time, in_place_of=()):
        if box.x > 60:
            raise BoxError('the box is outside of the image')
        self.results = {1: self._result(image, box)}
        return 1

    def update(self, image, time, only=None):
        if self.gate is not None:
            self.gate.wait(100)
        state = TrackState.LOST if image[0, 0] == 255 else TrackState.TRACKING
        return {1: self._result(image, BoundingBox(float(image[0, 0]), 6, 10, 12), state)}

    def learn(self):
        pass

    def reset(self):
        self.results = {}

    def _result(self, image, box, state=TrackState.TRACKING):
        self.seen.append(int(image[0, 0]))
        return TrackResult(box, 0.5, state, np.ones((4, 4), np.float32), box)


def session(tracker, policy='all', outputs=(), **parameters):
    make_node = partial(TrackerNode, tracker_factory=lambda settings: tracker)
    return NodeSession({'frame_policy': policy, 'image_reliability': 'reliable',
                        'image_depth': 0, **parameters},
                       outputs=outputs, make_node=make_node)


def image_message(value, stamp):
    header = Header()
    header.stamp.sec, header.stamp.nanosec = divmod(stamp, SECOND)
    return message_from_image(np.full((48, 64), value, np.uint8), header=header)


def play(player, values, in_flight=1):
    for index, value in enumerate(values):
        stamp = (index + 1) * SECOND
        if not index:
            player.start(START, stamp)
        player.send(stamp, image_message(value, stamp))
        player.settle(0 if not index else in_flight)
    player.settle(0)


def test_every_frame_is_answered_in_order():
    tracker = Follower()
    with session(tracker) as running:
        player = Player(running)
        play(player, range(40))
    exchanges = player.exchanges()
    assert tracker.seen == list(range(40))
    assert [e.stamp for e in exchanges] == [(i + 1) * SECOND for i in range(40)]
    assert exchanges[0].answer.box == START
    assert [e.answer.box.x for e in exchanges[1:]] == list(range(1, 40))
    assert all(e.latency > 0 and e.answer.status.state == 'tracking' for e in exchanges)


def test_lost_frames_are_answered_without_a_box():
    with session(Follower()) as running:
        player = Player(running)
        play(player, [1, 2, 255, 4])
    states = [(e.answer.status.state, e.answer.box is None) for e in player.exchanges()]
    assert states == [('tracking', False), ('tracking', False), ('lost', True),
                      ('tracking', False)]


def test_other_outputs_are_heard():
    heard = []
    with session(Follower(), outputs=('confidence_map', 'overlay', 'marker')) as running:
        player = Player(running, lambda message, stamp, seconds: heard.append(message))
        play(player, range(5))
        while {'confidence_map', 'overlay', 'marker'} - {h.output for h in heard}:
            message = running.next_message(100)
            assert message is not None
            heard.append(message)


def test_dropped_frames_have_no_latency():
    gate = threading.Event()
    with session(Follower(gate), policy='latest') as running:
        player = Player(running)
        play(player, [0])
        for index in range(1, 12):
            player.send((index + 1) * SECOND, image_message(index, (index + 1) * SECOND))
        player.listen_until(time.monotonic() + 0.2)
        gate.set()
        player.finish()
    exchanges = player.exchanges()
    answered = [e.latency is not None for e in exchanges]
    assert answered[0] and answered[-1]
    assert answered.count(False) == exchanges[-1].answer.status.dropped_frames


def test_refused_start_is_told():
    with session(Follower()) as running:
        player = Player(running)
        player.start(BoundingBox(61, 1, 5, 5), SECOND)
        player.send(SECOND, image_message(1, SECOND))
        with pytest.raises(NodeError, match='outside of the image'):
            player.settle(0)


class Pair(Follower):
    """Follows several targets; the second one is refused where it lies at y = 60."""

    def initialize(self, image, box, time, in_place_of=()):
        if box.y > 59:
            raise BoxError('the second box is outside of the image')
        self.results[len(self.results) + 1] = self._result(image, box)
        return len(self.results)

    def update(self, image, time, only=None):
        box = BoundingBox(float(image[0, 0]), 6, 10, 12)
        self.results = {number: self._result(image, box) for number in self.results}
        return self.results


def test_frame_is_answered_when_all_its_boxes_are_there():
    with session(Pair(), max_targets=2) as running:
        player = Player(running)
        player.start(START, SECOND)
        player.start(START, SECOND)
        for index in range(1, 9):
            player.send(index * SECOND, image_message(index, index * SECOND))
            player.settle(0)
            if index > 1:
                answer = player.exchanges()[-1].answer
                assert answer.boxed == {1, 2} and len(answer.statuses) == 2
    assert all(exchange.latency > 0 for exchange in player.exchanges())


def test_first_frame_is_answered_when_all_targets_are_started():
    """And there is room for all that is said of them."""
    tracker = Pair()
    with session(tracker, max_targets=64) as running:
        boxes, = [each for each in running._partner.subscriptions
                  if each.topic_name.endswith('/boxes')]
        assert boxes.qos_profile.depth >= 64 * 10
        player = Player(running)
        for _ in range(64):
            player.start(START, SECOND)
        player.send(SECOND, image_message(1, SECOND))
        player.settle(0)
        assert len(tracker.results) == 64
        for index in range(2, 7):
            player.send(index * SECOND, image_message(index, index * SECOND))
        player.settle(0)
    assert [len(exchange.answer.boxed) for exchange in player.exchanges()] == [64] * 6


def test_any_refused_start_is_told():
    """The one that is accepted stands first in the status."""
    with session(Pair(), max_targets=2) as running:
        player = Player(running)
        player.start(START, SECOND)
        player.send(SECOND, image_message(1, SECOND))
        player.settle(0)
        player.start(BoundingBox(5, 60, 10, 12), 2 * SECOND)
        player.send(2 * SECOND, image_message(1, 2 * SECOND))
        with pytest.raises(NodeError, match='second box is outside'):
            player.settle(0)
            player.listen_until(time.monotonic() + 100)


def test_node_that_does_not_start_is_told():
    with pytest.raises(NodeError, match='max_targets'):
        session(Follower(), max_targets=65)
    with pytest.raises(NodeError, match='did not start'):
        NodeSession({'preset': 'no such preset'})


def test_sessions_follow_each_other():
    for _ in range(2):
        with session(Follower()) as running:
            play(Player(running), [1, 2])
    assert not [t for t in threading.enumerate() if t.name == 'lmsco_tracker']


def test_waiting_for_a_moment_never_takes_for_ever():
    """A moment that is over by the time the wait begins is the rule at a camera's pace."""
    with session(Follower()) as running:
        def listen():
            for _ in range(20_000):
                running._heard.put(None)
                running.next_message(1.0)
                running.next_message(1e-9)
        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        thread.join(100)
        assert not thread.is_alive()


def test_node_that_ends_is_told():
    with session(Follower()) as running:
        player = Player(running)
        play(player, range(3))
        running._node.trigger_deactivate()
        player.send(9 * SECOND, image_message(1, 9 * SECOND))
        with pytest.raises(NodeError, match='not active any more'):
            player.settle(0)


def test_node_whose_thread_ends_is_told():
    with session(Follower()) as running:
        player = Player(running)
        play(player, range(3))

        def fail():
            raise RuntimeError('nobody expected this')
        # The node itself goes on whatever its callbacks raise; its partner does not.
        running._partner.create_timer(0.001, fail)
        player.send(9 * SECOND, image_message(1, 9 * SECOND))
        with pytest.raises(NodeError, match='the node ended: RuntimeError: nobody expected'):
            while True:
                player.listen_until(time.monotonic() + 0.05)
