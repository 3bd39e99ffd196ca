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

"""A recording of what camera and tracker say now, until somebody ends it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
import contextlib
from dataclasses import dataclass
from pathlib import Path
import time

from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from lmsco_ros.node.ros_arguments import explained, StartError
from lmsco_ros.node.run import in_ros
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.recorder import live_topics, Recorder

NODE_NAME = 'lmsco_recorder'
_LOOK_SECONDS = 0.1
_PATIENCE_SECONDS = 3.0


@dataclass(frozen=True)
class LivePlan:
    """
    What is recorded, and where to.

    Attributes
    ----------
    output : Path
        Folder of the new bag.
    image_topic : str
        Topic of the images, without the `/compressed` of its transport.
    compressed : bool
        Whether the compressed images are recorded in place of the raw ones.
    tracker, namespace : str
        Name of the node of the tracker, and its namespace.
    seconds : float or None
        How long; None: until it is broken off.

    """

    output: Path
    image_topic: str = 'image_raw'
    compressed: bool = False
    tracker: str = 'lmsco_tracker'
    namespace: str = '/'
    seconds: float | None = None

    @property
    def topics(self) -> dict[str, type]:
        """The topics with the types of their messages."""
        images = f'{self.image_topic}/compressed' if self.compressed else self.image_topic
        return live_topics(images, self.tracker, compressed=self.compressed)


class LiveRecording:
    """
    Records by a node of its own.

    Parameters
    ----------
    plan : LivePlan
    warn : callable
        Called with a line when no image comes.

    """

    def __init__(self, plan: LivePlan, warn: Callable[[str], object]) -> None:
        self._plan = plan
        self._warn = warn
        self._counts: dict[str, int] = {}
        self._error: OutputError | None = None

    @property
    def kept(self) -> str:
        """What is in the bag, in words; empty when there is none."""
        if not self._counts or not self._plan.output.exists():
            return ''
        counts = ', '.join(f'{topic} {count}' for topic, count in self._counts.items())
        return f'{sum(self._counts.values())} messages are in {self._plan.output}: {counts}'

    def run(self, advance: Callable[[Counter[str]], object]) -> None:
        """
        Record until the time is over; what breaks it off ends the bag, too.

        Parameters
        ----------
        advance : callable
            Called now and then with the number of messages so far, by the names of topics.

        Raises
        ------
        OutputError
            When the bag cannot be written.
        StartError
            When a name is none of ROS.

        """
        with in_ros(['--ros-args', '-r', f'__ns:={self._plan.namespace}']), _node() as node:
            recorder = Recorder(node, self._plan.topics, self._fail)
            _begin(recorder, self._plan.output)
            counts = recorder.counts
            assert counts is not None, 'it has begun'
            try:
                self._spin(node, counts, advance)
            finally:
                if self._error is None:
                    recorder.stop()
                    self._counts = dict(counts)
        if self._error is not None:
            raise self._error

    def _spin(self, node: Node, counts: Counter[str],
              advance: Callable[[Counter[str]], object]) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        begun = time.monotonic()
        end = begun + (self._plan.seconds or float('inf'))
        patience: float | None = begun + _PATIENCE_SECONDS
        try:
            while self._error is None and time.monotonic() < end:
                executor.spin_once(timeout_sec=max(
                    min(_LOOK_SECONDS, end - time.monotonic()), 0.0))
                advance(counts)
                if patience is not None and time.monotonic() > patience:
                    patience = None
                    self._complain(counts)
        finally:
            executor.shutdown()

    def _complain(self, counts: Counter[str]) -> None:
        """Say that no image has come so far."""
        images = next(iter(counts))
        if not counts[images]:
            self._warn(f'no image has come on {images} so far; is the camera running, and is that '
                       'its topic?')

    def _fail(self, error: OutputError) -> None:
        self._error = error


@contextlib.contextmanager
def _node() -> Iterator[Node]:
    """Make the node, and take it down."""
    try:
        node = Node(NODE_NAME)
    except (NameValidationException, rclpy_implementation.RCLError) as error:
        raise StartError(explained(str(error))) from error
    try:
        yield node
    finally:
        node.destroy_node()


def _begin(recorder: Recorder, output: Path) -> None:
    try:
        recorder.start(output)
    except (NameValidationException, rclpy_implementation.RCLError) as error:
        raise StartError(explained(str(error))) from error
