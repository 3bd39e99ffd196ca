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
What the node adds to the tracker's own time, from the camera's publish to the box heard.

A camera publishes 640x512 mono16 images at 30 Hz to the real node in the same process, and
a listener notes when each box arrives; the tracker's own time, which ~/status tells, is
subtracted. Prints the median and the 95th percentile of every repetition and the best.

Run on an otherwise idle machine: python benchmarks/node_overhead.py [--frames N]
"""

from __future__ import annotations

import argparse
import os
import threading
import time

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PolygonStamped  # noqa: E402
import numpy as np  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from sensor_msgs.msg import Image, RegionOfInterest  # noqa: E402

from lmsco_ros.core import BoundingBox, TrackResult, TrackState  # noqa: E402
from lmsco_ros.node.tracker_factory import make_tracker  # noqa: E402
from lmsco_ros.node.tracker_node import TrackerNode  # noqa: E402
from msg_adapters.image import message_from_image  # noqa: E402
from msg_adapters.status import status_from_message  # noqa: E402

SHAPE = (512, 640)
BOX = (300, 240, 40, 30)


class InstantTracker:
    """Answers at once: what remains is the node alone."""

    def initialize(self, image: np.ndarray, box: BoundingBox) -> TrackResult:
        """Return the box."""
        self._box = box
        return self.update(image)

    def update(self, image: np.ndarray) -> TrackResult:
        """Return the box again."""
        return TrackResult(self._box, 1.0, TrackState.TRACKING,
                           np.zeros((2, 2), np.float32), self._box)


class Camera(Node):
    """Sends images at a fixed rate, and notes when each was sent, tracked and answered."""

    def __init__(self, context: Context, frames: int) -> None:
        super().__init__('camera', context=context)
        self.sent: dict[int, float] = {}
        self.heard: dict[int, float] = {}
        self.tracker_seconds: dict[int, float] = {}
        self.finished = threading.Event()
        self._remaining = frames
        self._image = message_from_image(_scene())
        self._images = self.create_publisher(Image, 'image_raw', qos_profile_sensor_data)
        self._init = self.create_publisher(RegionOfInterest, 'init_box', 1)
        self.create_subscription(PolygonStamped, 'lmsco_tracker/box', self._on_box, 10)
        self.create_subscription(DiagnosticArray, 'lmsco_tracker/status', self._on_status, 10)
        self.create_timer(1 / 30, self._on_timer)

    def _on_timer(self) -> None:
        if not self.heard and self._init.get_subscription_count():
            x, y, width, height = BOX
            self._init.publish(RegionOfInterest(x_offset=x, y_offset=y, width=width,
                                                height=height))
        self._remaining -= bool(self.heard)
        if self._remaining < 0:
            self.finished.set()
            return
        stamp = self.get_clock().now()
        self._image.header.stamp = stamp.to_msg()
        self.sent[stamp.nanoseconds] = time.monotonic()
        self._images.publish(self._image)

    def _on_box(self, message: PolygonStamped) -> None:
        self.heard[_nanoseconds(message)] = time.monotonic()

    def _on_status(self, message: DiagnosticArray) -> None:
        status = status_from_message(message)
        self.tracker_seconds[_nanoseconds(message)] = status.tracker_ms / 1e3

    def overheads(self) -> np.ndarray:
        """Return milliseconds from sending to hearing, less the tracker's, per frame."""
        # The first second holds the starts, which come after their frames.
        stamps = sorted(self.heard.keys() & self.tracker_seconds.keys())[30:]
        return 1e3 * np.array([self.heard[s] - self.sent[s] - self.tracker_seconds[s]
                               for s in stamps])


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


def measure(frames: int, instant: bool) -> tuple[np.ndarray, float, int]:
    """Run once; return the overheads, the tracker's median and the number of lost frames."""
    context = Context()
    context.init()
    node = TrackerNode(
        context=context, tracker_factory=lambda settings: InstantTracker() if instant
        else make_tracker(settings), parameter_overrides=[Parameter('image_depth', value=5)])
    camera = Camera(context, frames)
    executors = [SingleThreadedExecutor(context=context) for _ in range(2)]
    for executor, member in zip(executors, (node, camera)):
        executor.add_node(member)
        threading.Thread(target=executor.spin, daemon=True).start()
    camera.finished.wait()
    for executor, member in zip(executors, (node, camera)):
        executor.shutdown()
        member.destroy_node()
    context.try_shutdown()
    tracker = 1e3 * float(np.median(list(camera.tracker_seconds.values())))
    return camera.overheads(), tracker, len(camera.sent) - len(camera.heard)


def main() -> None:
    """Measure with the real and with an instant tracker, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--frames', type=int, default=300)
    parser.add_argument('--repetitions', type=int, default=3)
    options = parser.parse_args()
    for name, instant in (('real tracker', False), ('instant tracker', True)):
        rows = []
        for _ in range(options.repetitions):
            overheads, tracker, unanswered = measure(options.frames, instant)
            rows.append(np.percentile(overheads, [50, 95]))
            print(f'{name}: tracker {tracker:.1f} ms, overhead p50 {rows[-1][0]:.2f} ms, '
                  f'p95 {rows[-1][1]:.2f} ms, {len(overheads)} frames, '
                  f'{unanswered} unanswered', flush=True)
        p50, p95 = np.min(rows, axis=0)
        print(f'{name}: best p50 {p50:.2f} ms, best p95 {p95:.2f} ms')


if __name__ == '__main__':
    main()
