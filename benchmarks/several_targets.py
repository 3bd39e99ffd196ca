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
How well a node answers where it follows several targets, beside one target.

The node runs in a process of its own; this one plays a camera, 640x512 mono16 at 30 Hz, best
effort, and listens. The pictures are the same for every number of targets; the numbers take turns,
so that a slow moment of the machine meets them all. A frame is answered when its status has come,
which is said after all boxes and states; the latency is from the publish call of the camera until
then. Printed is a table; with `--page` it takes the place of what stands between
`<!-- several-targets -->` and `<!-- /several-targets -->` there. The exit code is 1 when an aim is
missed. Run on an otherwise idle machine, with the package on the path:
python -m benchmarks.several_targets [--targets N ...] [--frames N] [--rounds N] [--page FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
from dataclasses import dataclass, field
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, RegionOfInterest
from std_srvs.srv import Trigger

from benchmarks.challenge_table import insert
from benchmarks.measurement import markdown_table, positive
from benchmarks.scenes import Clip, moving_scene
from benchmarks.storm_members import Member, NODE_NAME, PATIENCE_SECONDS
from msg_adapters.boxes import region_from_box
from msg_adapters.image import message_from_image
from msg_adapters.status import FrameStatus, statuses_from_message

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_large_images.xml'
COMMAND = (sys.executable, '-m', 'lmsco_ros.node.main')
COLUMNS = ('targets', 'frames', 'answered', 'tracking', 'p50 (ms)', 'p95 (ms)',
           'p95, over the first', 'p95 of the tracker alone (ms)')
SIZE, TARGET, RATE = (640, 512), 40, 30
LEAST_ANSWERED, MOST_RATIO = 0.97, 1.5
_CLIP_FRAMES = 60
# The first second holds what is left of the starts.
_WARM_UP = 30
_LAST_SECONDS = 2.0


@dataclass
class Answers:
    """
    What was answered of the frames with a number of targets.

    Attributes
    ----------
    sent : int
        Frames.
    latencies, tracker_ms : list of float
        Of the answered ones, and the tracker's own share of them, in milliseconds.
    tracking : int
        Answered frames in which all targets were seen.

    """

    sent: int = 0
    latencies: list[float] = field(default_factory=list)
    tracker_ms: list[float] = field(default_factory=list)
    tracking: int = 0

    @property
    def answered(self) -> float:
        """Share of the frames."""
        return len(self.latencies) / max(self.sent, 1)


class Camera(Member):
    """
    Sends a clip at a fixed rate, forth and back, and notes when each frame was answered.

    Parameters
    ----------
    namespace : str
        Of the node, too.
    clip : Clip
        What it shows.

    """

    def __init__(self, namespace: str, clip: Clip) -> None:
        super().__init__('camera', namespace)
        self._clip = clip
        self._messages = [message_from_image(image) for image in clip.frames]
        self._images = self.node.create_publisher(Image, 'image_raw', qos_profile_sensor_data)
        self._starts = self.node.create_publisher(RegionOfInterest, 'init_box', 64)
        self._reset = self.client(Trigger, 'reset')
        self.node.create_subscription(DiagnosticArray, f'{NODE_NAME}/status', self._on_status, 100)
        self._index = 0
        self._stands = True
        self._sent: dict[int, float] = {}
        self._heard: dict[int, tuple[float, list[FrameStatus]]] = {}
        self._timer = self.node.create_timer(1 / RATE, self._send)

    def play(self, targets: int, frames: int, answers: Answers) -> None:
        """
        Start on so many targets, send frames, and add what was answered.

        Raises
        ------
        RuntimeError
            When the node does not start on them.

        """
        self._index, self._stands = 0, True
        self._must(lambda: bool(self._starts.get_subscription_count() and self._heard))
        if self.ask(self._reset, Trigger.Request()) is None:
            raise RuntimeError('the node does not answer')
        self._must(lambda: self._newest() == 0)
        for box in (self._clip.start, *self._clip.others)[:targets]:
            self._starts.publish(region_from_box(box.as_tuple()))
        self._must(lambda: self._newest() == targets)
        self._stands = False
        self._must(lambda: self._index >= _WARM_UP)
        self._sent.clear()
        self._must(lambda: len(self._sent) >= frames)
        sent = dict(self._sent)
        self.spin(lambda: max(sent) in self._heard, _LAST_SECONDS)
        self._add(sent, answers)

    def _must(self, condition: Callable[[], bool]) -> None:
        """Let things happen until the condition holds."""
        if not self.spin(condition, 3 * PATIENCE_SECONDS):
            raise RuntimeError('the node does not answer')

    def _newest(self) -> int:
        """Return how many targets the last answer speaks of."""
        _, statuses = self._heard[max(self._heard)]
        return sum(status.state in ('tracking', 'uncertain', 'lost') for status in statuses)

    def _add(self, sent: Mapping[int, float], answers: Answers) -> None:
        answers.sent += len(sent)
        for stamp, began in sent.items():
            if stamp in self._heard:
                heard, statuses = self._heard[stamp]
                answers.latencies.append(1e3 * (heard - began))
                answers.tracker_ms.append(statuses[0].tracker_ms)
                answers.tracking += all(status.state == 'tracking' for status in statuses)

    def _send(self) -> None:
        last = len(self._messages) - 1
        message = self._messages[last - abs(last - self._index % (2 * last))]
        stamp = self.node.get_clock().now()
        message.header.stamp = stamp.to_msg()
        self._sent[stamp.nanoseconds] = time.monotonic()
        self._images.publish(message)
        self._index += not self._stands

    def _on_status(self, message: DiagnosticArray) -> None:
        stamp = message.header.stamp
        self._heard[10 ** 9 * stamp.sec + stamp.nanosec] = (
            time.monotonic(), statuses_from_message(message))


@contextlib.contextmanager
def node_process(namespace: str, most_targets: int) -> Iterator[None]:
    """Run the node in a process of its own."""
    process = subprocess.Popen(
        [*COMMAND, '--ros-args', '-r', f'__ns:={namespace}', '-p', f'max_targets:={most_targets}',
         '--log-level', 'warn'])
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def measure(numbers: Sequence[int], frames: int, rounds: int) -> dict[int, Answers]:
    """
    Return what was answered with each number of targets.

    Parameters
    ----------
    numbers : sequence of int
        Of targets; they take turns, beginning with another one in each round.
    frames : int
        Of each number in each round.
    rounds : int
        How often.

    """
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(PROFILE))
    namespace = f'/several_{os.getpid()}'
    answers = {number: Answers() for number in numbers}
    clip = moving_scene(SIZE, TARGET, _CLIP_FRAMES, vehicles=max(numbers))
    camera = Camera(namespace, clip)
    with contextlib.closing(camera), node_process(namespace, max(numbers)):
        for turn in range(rounds):
            for place in range(len(numbers)):
                number = numbers[(turn + place) % len(numbers)]
                camera.play(number, frames, answers[number])
    return answers


def report(answers: Mapping[int, Answers]) -> tuple[str, list[str]]:
    """Return the table as Markdown with what was aimed at, and the aims that are missed."""
    numbers = sorted(answers)
    most = answers[numbers[-1]]
    longest = {number: _percentile(answers[number].latencies, 95) for number in numbers}
    ratios = {number: longest[number] / longest[numbers[0]] for number in numbers}
    table = markdown_table(COLUMNS, [
        (number, told.sent, told.answered, told.tracking / max(len(told.latencies), 1),
         _percentile(told.latencies, 50), longest[number], ratios[number],
         _percentile(told.tracker_ms, 95)) for number, told in sorted(answers.items())])
    ratio = ratios[numbers[-1]]
    words = (f'With {numbers[-1]} targets {most.answered:.3f} of the frames are answered (aim: at '
             f'least {LEAST_ANSWERED}), and the 95th percentile of the latency is {ratio:.2f} '
             f'times that with {numbers[0]} (aim: at most {MOST_RATIO}).')
    missed = [text for wrong, text in (
        (most.answered < LEAST_ANSWERED, f'only {most.answered:.3f} of the frames are answered'),
        (not ratio <= MOST_RATIO, f'the latency is {ratio:.2f} times as long')) if wrong]
    return f'{table}\n\n{words}', missed


def _percentile(values: Sequence[float], percent: float) -> float:
    """Return the value that so many percent stay below; NaN where there are none."""
    return float(np.percentile(values, percent)) if values else np.nan


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and print the table or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--targets', type=positive, nargs='+', default=[1, 2, 3])
    parser.add_argument('--frames', type=positive, default=300, help='of each number and round')
    parser.add_argument('--rounds', type=positive, default=3)
    parser.add_argument('--page', type=Path)
    options = parser.parse_args(arguments)
    text, missed = report(measure(options.targets, options.frames, options.rounds))
    if options.page is None:
        print(text)
    else:
        page = insert(options.page.read_text(encoding='utf-8'), 'several-targets', text)
        options.page.write_text(page, encoding='utf-8')
    for aim in missed:
        print(f'several_targets: {aim}', file=sys.stderr)
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
