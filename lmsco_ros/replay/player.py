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

"""Frames to the node at a pace, answers back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
import time

from sensor_msgs.msg import CompressedImage, Image

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.replay.answers import Answer, Answers
from lmsco_ros.replay.bags.stamps import serialized_stamp
from lmsco_ros.replay.errors import NodeError
from lmsco_ros.replay.headers import header_at
from lmsco_ros.replay.node_session import Heard, NodeSession

_PATIENCE_SECONDS = 60.0
_POLL_SECONDS = 1.0


@dataclass(frozen=True)
class Exchange:
    """
    One frame and what the node said about it.

    Attributes
    ----------
    stamp : int
        Of the frame, in nanoseconds.
    answer : Answer
        Complete, or as far as it came.
    latency : float or None
        Seconds from sending the image to the box (the status, without one); None for a
        frame that the node dropped.

    """

    stamp: int
    answer: Answer
    latency: float | None


def _ignore(heard: Heard, stamp: int, seconds: float) -> None:
    """Do nothing with what was heard."""


class Player:
    """
    Feeds a session and keeps account of the answers.

    Parameters
    ----------
    session : NodeSession
        The running node.
    on_heard : callable
        Called with every message of the node about a frame that was sent, the stamp of the
        frame in nanoseconds, and the seconds since it was sent.

    """

    def __init__(self, session: NodeSession,
                 on_heard: Callable[[Heard, int, float], None] = _ignore) -> None:
        self._session = session
        self._on_heard = on_heard
        self._answers = Answers()
        self._sent: dict[int, float] = {}
        self._starts: Counter[int] = Counter()
        self._pending: list[int] = []

    def start(self, box: BoundingBox, stamp: int) -> None:
        """Ask the node to start on `box` in the frame with `stamp`, which may follow."""
        self._starts[stamp] += 1
        self._session.publish_start(box, header_at(stamp))

    def send(self, stamp: int, message: Image | CompressedImage | bytes) -> None:
        """Send the frame with `stamp`."""
        self._sent[stamp] = time.monotonic()
        self._pending.append(stamp)
        self._session.publish_image(message)

    def listen_until(self, moment: float) -> None:
        """
        Take what the node says until a moment on the clock of `time.monotonic`.

        Raises
        ------
        NodeError
            When the node reports that it could not do what it was asked for.

        """
        while True:
            heard = self._session.next_message(moment - time.monotonic())
            if heard is None:
                return
            self._take(heard)

    def settle(self, allowed: int) -> None:
        """
        Wait until at most `allowed` frames have no answer; no frame may be dropped.

        Raises
        ------
        NodeError
            When the node reports a failure, or does not answer for a minute.

        """
        self._wait(lambda: len(self._pending) <= allowed)

    def finish(self) -> None:
        """Wait for the answer to the last frame, which is never dropped; as `settle`."""
        if self._pending:
            last = self._pending[-1]
            self._wait(lambda: last not in self._pending)

    def exchanges(self, start: int = 0) -> list[Exchange]:
        """Return all frames in the order sent, from number `start` on."""
        return [self._exchange(stamp, sent)
                for stamp, sent in islice(self._sent.items(), start, None)]

    def _wait(self, is_done: Callable[[], bool]) -> None:
        last = time.monotonic()
        while not is_done():
            heard = self._session.next_message(_POLL_SECONDS)
            if heard is not None:
                last = time.monotonic()
                self._take(heard)
            elif time.monotonic() - last > _PATIENCE_SECONDS:
                raise NodeError(f'the node did not answer for {_PATIENCE_SECONDS:.0f} seconds; '
                                'its log above may say why')

    def _take(self, heard: Heard) -> None:
        answer = self._answers.take(heard)
        stamp = serialized_stamp(heard.data)
        if stamp in self._sent:
            self._on_heard(heard, stamp, heard.received - self._sent[stamp])
        if answer.failure:
            raise NodeError(f'the node refuses: {answer.failure}')
        # Of more starts than there may be targets, the first are superseded.
        starts = min(self._starts[stamp], self._session.max_targets)
        if answer.is_tracked and answer.started >= starts and stamp in self._pending:
            # The node answers in order: what it left out will never be answered.
            del self._pending[:self._pending.index(stamp) + 1]

    def _exchange(self, stamp: int, sent: float) -> Exchange:
        answer = self._answers[stamp]
        return Exchange(stamp, answer, answer.received - sent if answer.is_tracked else None)
