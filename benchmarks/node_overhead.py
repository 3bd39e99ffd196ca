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
What the node adds to the tracker's own time, at 640x512 mono16 and 30 Hz.

The node runs in a process of its own; this one plays camera and listener. Printed are the
median and the 95th percentile, of every repetition and the best of each, of

- inside: from the arrival of the image in the node to the answer, less the tracker's time,
  both as ~/status tells them;
- end to end: from the camera's publish call to the box heard, less the tracker's time; this
  holds both deliveries and what this process adds.

With `real` the default tracker works; frames that came while it was still at the one before
are counted as waiting and left out, for their delay is the tracker's. With `instant` the node
is alone. With `echo` a bare node answers every image with a fixed box: what ROS itself costs.
Run on an otherwise idle machine, with the package on the path:
python benchmarks/node_overhead.py [--frames N] [--repetitions N]
"""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterator
import contextlib
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, RegionOfInterest

from lmsco_ros.core import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.tracker_factory import make_tracker
from lmsco_ros.node.tracker_node import TrackerNode
from msg_adapters.boxes import polygon_from_box
from msg_adapters.image import message_from_image
from msg_adapters.status import FrameStatus, message_from_status, status_from_message

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_large_images.xml'
SHAPE = (512, 640)
BOX = (300, 240, 40, 30)
# The first second holds the starts, whose frames came before.
WARM_UP = 30


class InstantTracker:
    """Answers at once: what remains is the node."""

    def __init__(self) -> None:
        self.results: dict[int, TrackResult] = {}

    def initialize(self, image: np.ndarray, box: BoundingBox, time: float,
                   in_place_of: Collection[int] = ()) -> int:
        """Take the box for the only target."""
        self.results = {1: TrackResult(box, 1.0, TrackState.TRACKING,
                                       np.zeros((2, 2), np.float32), box)}
        return 1

    def update(self, image: np.ndarray, time: float,
               only: Collection[int] | None = None) -> dict[int, TrackResult]:
        """Return the box again."""
        return self.results

    def learn(self) -> None:
        """Do nothing."""

    def drop(self, number: int) -> None:
        """Forget the only target."""
        self.reset()

    def reset(self) -> None:
        """Forget the target."""
        self.results = {}


class Echo(Node):
    """Answers every image as the tracker node does, and does nothing else."""

    def __init__(self) -> None:
        super().__init__('lmsco_tracker')
        self._box = self.create_publisher(PolygonStamped, '~/box', 10)
        self._status = self.create_publisher(DiagnosticArray, '~/status', 10)
        self.create_subscription(Image, 'image_raw', self._on_image, qos_profile_sensor_data)
        self.create_subscription(RegionOfInterest, 'init_box', lambda region: None, 10)

    def _on_image(self, message: Image) -> None:
        self._box.publish(polygon_from_box(BOX, message.header))
        self._status.publish(message_from_status(
            FrameStatus('tracking', 1, 1.0, 0.0, 0.0, 0), self.get_name(), message.header))


NODES = {
    'real': lambda: TrackerNode(tracker_factory=make_tracker),
    'instant': lambda: TrackerNode(tracker_factory=lambda settings: InstantTracker()),
    'echo': Echo,
}


class Camera(Node):
    """Sends images at a fixed rate, and notes when each was sent and answered."""

    def __init__(self, frames: int) -> None:
        super().__init__('camera')
        self.sent: dict[int, float] = {}
        self.heard: dict[int, float] = {}
        self.statuses: dict[int, FrameStatus] = {}
        self.remaining = frames + WARM_UP
        self._image = message_from_image(_scene())
        self._images = self.create_publisher(Image, 'image_raw', qos_profile_sensor_data)
        self._init = self.create_publisher(RegionOfInterest, 'init_box', 1)
        self.create_subscription(PolygonStamped, 'lmsco_tracker/box', self._on_box, 10)
        self.create_subscription(DiagnosticArray, 'lmsco_tracker/status', self._on_status, 10)
        self.create_timer(1 / 30, self._on_timer)

    def _on_timer(self) -> None:
        if not self.heard:
            x, y, width, height = BOX
            self._init.publish(RegionOfInterest(x_offset=x, y_offset=y, width=width,
                                                height=height))
        self.remaining -= bool(self.heard)
        stamp = self.get_clock().now()
        self._image.header.stamp = stamp.to_msg()
        self.sent[stamp.nanoseconds] = time.monotonic()
        self._images.publish(self._image)

    def _on_box(self, message: PolygonStamped) -> None:
        self.heard[_nanoseconds(message)] = time.monotonic()

    def _on_status(self, message: DiagnosticArray) -> None:
        self.statuses[_nanoseconds(message)] = status_from_message(message)

    def figures(self) -> np.ndarray:
        """
        Return one row for each answered frame.

        Columns are milliseconds inside, end to end and of the tracker, and whether the frame
        had to wait for the one before.
        """
        stamps = sorted(self.heard.keys() & self.statuses.keys())[WARM_UP:]
        return np.array([(
            self.statuses[s].latency_ms - self.statuses[s].tracker_ms,
            1e3 * (self.heard[s] - self.sent[s]) - self.statuses[s].tracker_ms,
            self.statuses[s].tracker_ms,
            self.heard[before] > self.sent[s]) for before, s in zip(stamps, stamps[1:])])


def _nanoseconds(message: PolygonStamped | DiagnosticArray) -> int:
    return message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec


def _scene() -> np.ndarray:
    """Return a warm spot before a rough background, as 16-bit counts."""
    rows, columns = np.mgrid[:SHAPE[0], :SHAPE[1]]
    x, y, width, height = BOX
    spot = np.exp(-((columns - x - width / 2) / width * 3) ** 2
                  - ((rows - y - height / 2) / height * 3) ** 2)
    noise = np.random.default_rng(0).normal(0, 20, SHAPE)
    return (8000 + 200 * np.sin(rows / 9) * np.cos(columns / 11) + 900 * spot
            + noise).astype(np.uint16)


def run_node(name: str) -> None:
    """Be the node's process."""
    rclpy.init()
    node = NODES[name]()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()
    node.destroy_node()
    rclpy.try_shutdown()


@contextlib.contextmanager
def node_process(name: str) -> Iterator[None]:
    """Run the node beside this process."""
    process = subprocess.Popen([sys.executable, __file__, '--node', name],
                               stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def measure(name: str, frames: int) -> np.ndarray:
    """Run once and return the figures of every answered frame."""
    camera = Camera(frames)
    with node_process(name):
        while camera.remaining > 0:
            rclpy.spin_once(camera)
    camera.destroy_node()
    return camera.figures()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--frames', type=int, default=300)
    parser.add_argument('--repetitions', type=int, default=3)
    parser.add_argument('--node', choices=NODES, help='be the node (used internally)')
    options = parser.parse_args()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if options.node:
        run_node(options.node)
        return
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(PROFILE))
    rclpy.init()
    for name in NODES:
        rows = []
        for _ in range(options.repetitions):
            figures = measure(name, options.frames)
            waited = figures[:, 3] > 0
            rows.append(np.percentile(figures[~waited, :2], [50, 95], axis=0).T.ravel())
            print(f'{name}: {_sentence(rows[-1])}; tracker {np.median(figures[:, 2]):.1f} ms; '
                  f'{len(figures)} frames, {np.sum(waited)} waiting', flush=True)
        print(f'{name}, best of {options.repetitions}: {_sentence(np.min(rows, axis=0))}')
    rclpy.shutdown()


def _sentence(values: np.ndarray) -> str:
    return ('inside p50 {:.2f} p95 {:.2f} ms, end to end p50 {:.2f} p95 {:.2f} ms'
            .format(*values))


if __name__ == '__main__':
    main()
