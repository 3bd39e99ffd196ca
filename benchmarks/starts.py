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

"""
Start the node again and again, and end each by a signal at a random moment.

SIGINT and SIGTERM take turns, and so do the moments: while the process starts, while the node
tracks, and while it goes through lifecycle transitions. Printed is a table of exit codes, times
from the signal to the end, and tracebacks; with `--page` it takes the place of what stands between
`<!-- starts -->` and `<!-- /starts -->` there. The exit code is 1 when a start did not end with
code 0 and without a traceback. Linux only. With the package on the path:
python -m benchmarks.starts [--count N] [--start-up SECONDS] [--bare] [--page docs/field.md]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
from dataclasses import dataclass
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time

from geometry_msgs.msg import PolygonStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image, RegionOfInterest

from benchmarks.challenge_table import insert
from benchmarks.measurement import markdown_table
from lmsco_ros.synthetic import render_scene, SceneConfig
from msg_adapters.image import message_from_image

NODE_NAME = 'lmsco_tracker'
SIGNALS = (signal.SIGINT, signal.SIGTERM)
# As the command that `make venv` installs: signals wait while the interpreter starts.
HOLD_BACK = ('env', '--block-signal=INT,TERM,HUP')
COLUMNS = ('signal', 'starts', 'ended with code 0', 'other codes', 'tracebacks', 'median (ms)',
           'p99 (ms)', 'longest (ms)')
_PERIOD = 1 / 30
_PATIENCE_SECONDS = 60.0
# A signal comes at most this long after the node began to track, or with transitions.
_LATEST_SECONDS = 1.0


@dataclass(frozen=True)
class End:
    """How one start ended; `code` is None when it had to be killed."""

    moment: str
    signal: signal.Signals
    seconds: float
    code: int | None
    traceback: bool

    @property
    def clean(self) -> bool:
        """Whether there is nothing to complain of."""
        return self.code == 0 and not self.traceback


class Operator:
    """
    Camera and user of one node.

    Parameters
    ----------
    context : Context
        Of this process.
    namespace : str
        Of the node; one for each start, since the middleware believes in a node that was ended
        for a while.

    """

    def __init__(self, context: Context, namespace: str) -> None:
        self.tracking = False
        self._node = Node('operator', context=context, namespace=namespace)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        frame = next(iter(render_scene(SceneConfig(320, 256, frames=1))))
        self._image, self._box = message_from_image(frame.image), frame.box
        self._images = self._node.create_publisher(Image, 'image_raw', 10)
        self._starts = self._node.create_publisher(RegionOfInterest, 'init_box', 10)
        self._node.create_subscription(PolygonStamped, f'{NODE_NAME}/box', self._on_box, 10)
        self._transitions = self._node.create_client(ChangeState, f'{NODE_NAME}/change_state')
        self._node.create_timer(_PERIOD, self._send)

    def track(self) -> None:
        """Wait until the node tracks."""
        self._spin(lambda: self.tracking, _PATIENCE_SECONDS)
        if not self.tracking:
            raise TimeoutError(f'the node did not track within {_PATIENCE_SECONDS:.0f} s')

    def go_through_transitions(self) -> None:
        """Deactivate and activate the node in turn, as fast as it answers."""
        self._change([Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE])

    def let_pass(self, seconds: float) -> None:
        """Go on for some time."""
        self._spin(lambda: False, seconds)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()

    def _spin(self, condition: Callable[[], bool], seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while not condition() and (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=min(left, _PERIOD))

    def _send(self) -> None:
        self._image.header.stamp = self._node.get_clock().now().to_msg()
        self._images.publish(self._image)
        if not self.tracking:
            box = self._box
            self._starts.publish(RegionOfInterest(
                x_offset=round(box.x), y_offset=round(box.y), width=round(box.width),
                height=round(box.height)))

    def _on_box(self, box: PolygonStamped) -> None:
        self.tracking = True

    def _change(self, transitions: Sequence[int]) -> None:
        """Ask for the first transition, and for the next when it is answered."""
        first, *others = transitions
        request = ChangeState.Request(transition=Transition(id=first))
        self._transitions.call_async(request).add_done_callback(
            lambda answered: self._change([*others, first]))


def _while_starting(operator: Operator, seconds: float) -> None:
    operator.let_pass(seconds)


def _while_tracking(operator: Operator, seconds: float) -> None:
    operator.track()
    operator.let_pass(seconds)


def _while_changing(operator: Operator, seconds: float) -> None:
    operator.track()
    operator.go_through_transitions()
    operator.let_pass(seconds)


MOMENTS: dict[str, Callable[[Operator, float], None]] = {
    'while it starts': _while_starting,
    'while it tracks': _while_tracking,
    'during transitions': _while_changing,
}


@contextlib.contextmanager
def _started(context: Context, namespace: str, command: Sequence[str],
             ) -> Iterator[tuple[subprocess.Popen, Operator]]:
    """Run the node in a process of its own, and an operator for it."""
    operator = Operator(context, namespace)
    process = subprocess.Popen(
        [*command, '--ros-args', '-r', f'__ns:={namespace}'], stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True)
    try:
        yield process, operator
    finally:
        process.kill()
        process.communicate()
        operator.close()


def _end(process: subprocess.Popen, number: signal.Signals, moment: str) -> End:
    """Send a signal, and tell what becomes of the process."""
    began = time.monotonic()
    process.send_signal(number)
    try:
        output, _ = process.communicate(timeout=_PATIENCE_SECONDS)
    except subprocess.TimeoutExpired:
        return End(moment, number, _PATIENCE_SECONDS, None, False)
    return End(moment, number, time.monotonic() - began, process.returncode,
               'Traceback' in output)


def starts(count: int, *, command: Sequence[str], start_up: float = 3.0,
           seed: int = 0) -> Iterator[End]:
    """
    Start the node so many times, and yield how each start ended.

    Parameters
    ----------
    count : int
        Starts.
    command : sequence of str
        Starts the node.
    start_up : float
        Seconds within which signals come that are to come while the process starts.
    seed : int
        Of the random moments.

    """
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    moments = random.Random(seed)
    context = Context()
    rclpy.init(context=context)
    try:
        for index in range(count):
            moment, wait = list(MOMENTS.items())[index % len(MOMENTS)]
            latest = start_up if wait is _while_starting else _LATEST_SECONDS
            namespace = f'/starts_{os.getpid()}_{index}'
            with _started(context, namespace, command) as (process, operator):
                wait(operator, moments.uniform(0, latest))
                yield _end(process, SIGNALS[index // len(MOMENTS) % len(SIGNALS)], moment)
    finally:
        rclpy.try_shutdown(context=context)


def starts_table(ends: Sequence[End]) -> str:
    """Return the figures for each moment and signal, and in all, as a Markdown table."""
    groups = {f'{number.name} {moment}': [end for end in ends if (end.signal, end.moment) == (
        number, moment)] for moment in MOMENTS for number in SIGNALS}
    rows = [(name, *_figures(group)) for name, group in groups.items() if group]
    return markdown_table(COLUMNS, [*rows, ('**in all**', *_figures(ends))])


def _figures(ends: Sequence[End]) -> list[str]:
    others = sorted(str(end.code) for end in ends if end.code != 0)
    milliseconds = [1e3 * end.seconds for end in ends]
    return [str(len(ends)), str(len(ends) - len(others)), ', '.join(others) or '–',
            str(sum(end.traceback for end in ends)),
            *(f'{value:.0f}' for value in (*np.percentile(milliseconds, [50, 99]),
                                           max(milliseconds)))]


def main(arguments: Sequence[str] | None = None) -> int:
    """Start, end, and print the table or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--count', type=int, default=100)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--start-up', type=float, default=3.0,
                        help='seconds within which signals come while it starts')
    parser.add_argument('--bare', action='store_true',
                        help='do not hold signals back while the interpreter starts')
    parser.add_argument('--page', type=Path)
    parser.add_argument('--name', default='starts')
    options = parser.parse_args(arguments)
    command = [sys.executable, '-m', 'lmsco_ros.node.main']
    ends = list(starts(options.count, start_up=options.start_up, seed=options.seed,
                       command=command if options.bare else [*HOLD_BACK, *command]))
    table = starts_table(ends)
    if options.page is None:
        print(table)
    else:
        page = insert(options.page.read_text(encoding='utf-8'), options.name, table)
        options.page.write_text(page, encoding='utf-8')
    return 0 if all(end.clean for end in ends) else 1


if __name__ == '__main__':
    sys.exit(main())
