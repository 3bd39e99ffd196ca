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
Send half an hour of images through the node, as fast as they are answered; nothing may grow.

The node runs in a process of its own; this one sends each image as soon as the one before is
answered, starts the target anew now and then, and looks at the node's memory, threads and open
files. Written are one row for every 300 frames and a plot of them; said is whether, after the
first 1,800 frames (one minute at 30 Hz), the resident memory stays within 2 %, threads and open
files do not grow, and the 99th percentile of the latency is stable. The exit code is 1 when
something is not. Linux only. With the package on the path:
python benchmarks/soak.py [--frames N] [--pictures] [--output DIRECTORY]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
import csv
from dataclasses import dataclass
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image

from lmsco_ros.core import BoundingBox
from lmsco_ros.replay.headers import header_at
from lmsco_ros.synthetic import render_scene, SceneConfig
from msg_adapters.boxes import polygon_from_box
from msg_adapters.image import message_from_image
from msg_adapters.status import FrameStatus, status_from_message

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_large_images.xml'
NODE_NAME = 'lmsco_tracker'
PERIOD_NS = 10 ** 9 // 30
MOST_GROWTH = 0.02
# Percentiles of few frames scatter.
MOST_SLOWDOWN = 1.5
PATIENCE_SECONDS = 60.0


@dataclass(frozen=True)
class Plan:
    """What to run: `every` is the distance of two samples, all in frames and pixels."""

    frames: int = 54_000
    every: int = 300
    warm_up: int = 1_800
    restart: int = 900
    width: int = 640
    height: int = 512
    pictures: bool = False
    preset: str = 'default'


@dataclass(frozen=True)
class Sample:
    """What the node took after so many frames; latencies are of the frames since the last."""

    frames: int
    elapsed_s: float
    rss_mib: float
    threads: int
    open_files: int
    latency_p50_ms: float
    latency_p95_ms: float
    latency_p99_ms: float
    tracked: float


class Camera(Node):
    """Sends images and waits for the answer to each."""

    def __init__(self, plan: Plan, context: Context) -> None:
        super().__init__('camera', context=context)
        self._context = context
        scene = list(render_scene(SceneConfig(plan.width, plan.height, frames=120)))
        # There and back again: the film has no cut.
        self._film = [(message_from_image(frame.image), frame.box)
                      for frame in [*scene, *scene[-2:0:-1]]]
        self._images = self.create_publisher(Image, 'image_raw', 10)
        self._starts = self.create_publisher(PolygonStamped, 'init_box_stamped', 10)
        self.create_subscription(DiagnosticArray, f'{NODE_NAME}/status', self._on_status, 10)
        for picture in ('overlay', 'confidence_map') if plan.pictures else ():
            self.create_subscription(Image, f'{NODE_NAME}/{picture}', lambda message: None, 10)
        self._answer: tuple[int, FrameStatus] | None = None
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self)

    def wait_for_node(self) -> None:
        """Wait until the node hears and is heard."""
        self._spin_until(lambda: self._images.get_subscription_count()
                         and self._starts.get_subscription_count()
                         and self.count_publishers(f'{NODE_NAME}/status'))
        # Each learns of the other in its own time; an answer tells that both did.
        self._spin_until(self._is_answered)

    def send(self, number: int, *, start: bool) -> FrameStatus:
        """Send a frame, with a box to start on if need be, and return the answer."""
        image, box = self._film[number % len(self._film)]
        stamp = (number + 1) * PERIOD_NS
        image.header = header_at(stamp)
        if start:
            self._starts.publish(polygon_from_box(_visible(box, image).as_tuple(), image.header))
        self._images.publish(image)
        self._spin_until(lambda: self._answer is not None and self._answer[0] == stamp)
        return self._answer[1]

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.destroy_node()

    def _is_answered(self) -> bool:
        self._images.publish(self._film[0][0])
        return self._answer is not None

    def _on_status(self, message: DiagnosticArray) -> None:
        stamp = message.header.stamp
        self._answer = stamp.sec * 10 ** 9 + stamp.nanosec, status_from_message(message)

    def _spin_until(self, condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + PATIENCE_SECONDS
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f'the node did not answer for {PATIENCE_SECONDS:.0f} s')
            self._executor.spin_once(timeout_sec=0.1)


def _visible(box: BoundingBox, image: Image) -> BoundingBox:
    """Return the part of the box that is in the image."""
    left, top = max(box.x, 0.0), max(box.y, 0.0)
    return BoundingBox(left, top, min(box.x + box.width, image.width) - left,
                       min(box.y + box.height, image.height) - top)


@contextlib.contextmanager
def node_process(plan: Plan) -> Iterator[int]:
    """Run the node beside this process; yield its process id."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'lmsco_ros.node.main', '--ros-args',
         '-p', f'preset:={plan.preset}', '-p', 'image_reliability:=reliable'])
    try:
        yield process.pid
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def soak(plan: Plan) -> Iterator[Sample]:
    """Run the plan and yield the samples as they are taken."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(PROFILE))
    context = Context()
    rclpy.init(context=context)
    camera = Camera(plan, context)
    try:
        with node_process(plan) as pid:
            camera.wait_for_node()
            yield from _samples(plan, camera, pid)
    finally:
        camera.close()
        rclpy.try_shutdown(context=context)


def _samples(plan: Plan, camera: Camera, pid: int) -> Iterator[Sample]:
    begin, latencies, tracked = time.monotonic(), [], 0
    for number in range(plan.frames):
        status = camera.send(number, start=number % plan.restart == 0)
        latencies.append(status.latency_ms)
        tracked += status.state in ('tracking', 'uncertain')
        if (number + 1) % plan.every == 0:
            yield Sample(number + 1, time.monotonic() - begin, *_resources(pid),
                         *np.percentile(latencies, [50, 95, 99]), tracked / plan.every)
            latencies, tracked = [], 0


def _resources(pid: int) -> tuple[float, int, int]:
    """Return resident memory in MiB, threads and open files of a process."""
    process = Path('/proc') / str(pid)
    pages = int((process / 'statm').read_text().split()[1])
    return (pages * os.sysconf('SC_PAGE_SIZE') / 2 ** 20, len(list((process / 'task').iterdir())),
            len(list((process / 'fd').iterdir())))


def complaints(samples: Sequence[Sample], warm_up: int) -> list[str]:
    """
    Return what grew after the warm-up; empty when nothing did.

    Parameters
    ----------
    samples : sequence of Sample
        In the order in which they were taken.
    warm_up : int
        Frames; there has to be a sample there and three more behind it.

    """
    settled = [sample for sample in samples if sample.frames >= warm_up]
    if len(settled) < 4:
        return [f'{len(settled)} samples after {warm_up} frames are too few; run more frames']
    first, found = settled[0], []
    growth = max(sample.rss_mib for sample in settled) / first.rss_mib - 1
    if growth > MOST_GROWTH:
        found.append(f'resident memory grew by {growth:.1%} from {first.rss_mib:.1f} MiB')
    for name in ('threads', 'open_files'):
        most = max(getattr(sample, name) for sample in settled)
        if most > getattr(first, name):
            found.append(f'{name} grew from {getattr(first, name)} to {most}')
    p99 = [sample.latency_p99_ms for sample in settled]
    third = max(len(p99) // 3, 1)
    slowdown = float(np.median(p99[-third:]) / np.median(p99[:third]))
    if slowdown > MOST_SLOWDOWN:
        found.append(f'the 99th percentile of the latency grew to {slowdown:.2f} times')
    return found


def summary(samples: Sequence[Sample], warm_up: int) -> str:
    """Return the figures behind the verdict in one line."""
    settled = [sample for sample in samples if sample.frames >= warm_up] or list(samples)
    rss = [sample.rss_mib for sample in settled]
    p99 = [sample.latency_p99_ms for sample in settled]
    return (f'{samples[-1].frames} frames in {samples[-1].elapsed_s:.0f} s; after {warm_up}: '
            f'resident memory {min(rss):.1f} to {max(rss):.1f} MiB, threads '
            f'{settled[0].threads} to {settled[-1].threads}, open files '
            f'{settled[0].open_files} to {settled[-1].open_files}, latency p99 '
            f'{min(p99):.1f} to {max(p99):.1f} ms')


def write_csv(samples: Sequence[Sample], path: Path) -> None:
    """Write one row for each sample."""
    with path.open('w', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(Sample.__dataclass_fields__)
        for sample in samples:
            writer.writerow(round(value, 3) for value in vars(sample).values())


def plot(samples: Sequence[Sample], warm_up: int, path: Path) -> None:
    """Draw memory, threads and files, and latency over the frames."""
    figure = Figure(figsize=(9, 7.5), layout='constrained')
    panels = figure.subplots(3, 1, sharex=True)
    frames = [sample.frames for sample in samples]

    def lines(panel: Axes, names: dict[str, str], unit: str) -> None:
        for name, label in names.items():
            panel.plot(frames, [getattr(sample, name) for sample in samples], marker='.',
                       label=label)
        panel.axvline(warm_up, color='gray', linestyle=':')
        panel.set_ylabel(unit)
        panel.grid(alpha=0.3)
        panel.margins(y=0.15)

    lines(panels[0], {'rss_mib': 'resident memory'}, 'MiB')
    settled = [sample.rss_mib for sample in samples if sample.frames >= warm_up]
    if settled:
        panels[0].axhspan(settled[0] * (1 - MOST_GROWTH), settled[0] * (1 + MOST_GROWTH),
                          alpha=0.15, label='2 % around the end of the warm-up')
    lines(panels[1], {'threads': 'threads', 'open_files': 'open files'}, 'number')
    lines(panels[2], {'latency_p50_ms': 'latency: median', 'latency_p95_ms': '95th percentile',
                      'latency_p99_ms': '99th percentile'}, 'milliseconds')
    panels[1].set_ylim(bottom=0)
    panels[2].set_ylim(bottom=0)
    for panel in panels:
        panel.legend(loc='lower right', bbox_to_anchor=(1, 1), ncols=3, frameon=False)
    panels[2].set_xlabel('frames (dotted: end of the warm-up)')
    figure.savefig(path, dpi=110)


def _options() -> tuple[Plan, Path]:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--output', type=Path, default=Path('soak'))
    for name, default in vars(Plan()).items():
        option = f'--{name.replace("_", "-")}'
        if isinstance(default, bool):
            parser.add_argument(option, action='store_true')
        else:
            parser.add_argument(option, type=type(default), default=default)
    options = vars(parser.parse_args())
    output = options.pop('output')
    plan = Plan(**options)
    if plan.frames < plan.every:
        parser.error(f'{plan.frames} frames give no sample; '
                     f'give {plan.every} or more, or a smaller --every')
    return plan, output


def main() -> int:
    """Run, write and judge."""
    plan, output = _options()
    output.mkdir(parents=True, exist_ok=True)
    samples = []
    for sample in soak(plan):
        samples.append(sample)
        print(f'{sample.frames} frames, {sample.elapsed_s:.0f} s: {sample.rss_mib:.1f} MiB, '
              f'{sample.threads} threads, {sample.open_files} open files, latency p99 '
              f'{sample.latency_p99_ms:.1f} ms, {sample.tracked:.0%} tracked', flush=True)
        write_csv(samples, output / 'soak.csv')
    plot(samples, plan.warm_up, output / 'soak.png')
    found = complaints(samples, plan.warm_up)
    print(summary(samples, plan.warm_up))
    print('; '.join(found) or 'nothing grew')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
