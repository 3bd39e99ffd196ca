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
How late the operator's page is, and what it costs the tracker.

A rendered camera of 640x512 at 30 Hz (this process), the tracker, the console and a browser, each
a process of its own, on one machine. Printed are, of one run,

- the time from the stamp of an image, taken just before it is published, until its frame is on
  the screen: the browser has painted it, and goes on to what comes after; median and 95th
  percentile over all drawn frames;
- what the tracker does while no page is open and while one is, in turns: frames that it answers
  in a second, its own time for a frame, and the frames a second that this time allows.

Where there is no Chromium with its driver and selenium, a WebSocket client that decodes every
picture takes the place of the browser, and the output says so. Run it on an otherwise idle
machine: python -m benchmarks.page_latency [--seconds N] [--turns N]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import dataclass, field
import importlib.util
import json
import os
from pathlib import Path
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any, Protocol

import cv2
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image

from benchmarks.measurement import markdown_table
from lmsco_ros.synthetic import render_scene, SceneConfig
from msg_adapters.boxes import polygon_from_box
from msg_adapters.image import message_from_image
from msg_adapters.status import FrameStatus, status_from_message

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_large_images.xml'
# Before somebody covers the target.
SCENE, SHOWN = SceneConfig(width=640, height=512, frames=300, clutter=15), 80
RATE = 30.0
WARM_UP_SECONDS = 2.0
PATIENCE_SECONDS = 60.0
NOTE_WHAT_IS_DRAWN = """
    window.drawn = [];
    const canvas = document.getElementById('stage');
    new MutationObserver(() => {
        const { stamp } = JSON.parse(canvas.dataset.state);
        requestAnimationFrame(() => {
            // What is posted now comes when the frame has been painted.
            const painted = new MessageChannel();
            painted.port1.onmessage = () => window.drawn.push([stamp, Date.now()]);
            painted.port2.postMessage(null);
        });
    }).observe(canvas, { attributes: true, attributeFilter: ['data-state'] });"""


class Viewer(Protocol):
    """Who looks at the page."""

    name: str

    def open(self, address: str) -> None:
        """Begin to look."""

    def close(self) -> list[tuple[int, float]]:
        """Look no longer; return stamps in nanoseconds, and when each was drawn, in seconds."""


class Browser:
    """The page in Chromium, without a window."""

    def __init__(self) -> None:
        from selenium import webdriver
        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which('chromium')
        for argument in ('--headless=new', '--no-sandbox', '--disable-gpu', '--no-proxy-server',
                         '--disable-background-networking', '--window-size=1280,800'):
            options.add_argument(argument)
        self._driver = webdriver.Chrome(
            options, webdriver.ChromeService(shutil.which('chromedriver')))
        self.name = f'Chromium {self._driver.capabilities["browserVersion"]}'

    def open(self, address: str) -> None:
        """Load the page."""
        self._driver.get(address)
        self._driver.execute_script(NOTE_WHAT_IS_DRAWN)

    def close(self) -> list[tuple[int, float]]:
        """Load another page."""
        drawn = self._driver.execute_script('return window.drawn;')
        self._driver.get('about:blank')
        return [(int(stamp), milliseconds / 1e3) for stamp, milliseconds in drawn]

    def quit(self) -> None:
        """End the browser."""
        self._driver.quit()


class Client:
    """Asks for frames as the page does, and decodes them."""

    name = 'a WebSocket client that decodes the pictures, in place of a browser'

    def __init__(self) -> None:
        self._ended = threading.Event()
        self._thread = threading.Thread()
        self._drawn: list[tuple[int, float]] = []

    def open(self, address: str) -> None:
        """Connect, and go on in a thread."""
        self._ended.clear()
        self._thread = threading.Thread(target=self._look, args=(address,))
        self._thread.start()

    def close(self) -> list[tuple[int, float]]:
        """Go away."""
        self._ended.set()
        self._thread.join()
        drawn, self._drawn = self._drawn, []
        return drawn

    def quit(self) -> None:
        """Nothing is left."""

    def _look(self, address: str) -> None:
        from websockets.sync.client import connect
        number = 0
        with connect(address.replace('http', 'ws') + 'socket', origin=address.rstrip('/'),
                     proxy=None) as socket:
            socket.recv()
            while not self._ended.is_set():
                socket.send(json.dumps({'type': 'next', 'drawn': number}))
                data = socket.recv()
                if isinstance(data, str):
                    continue
                (length,) = struct.unpack_from('>I', data)
                state = json.loads(data[4:4 + length])
                cv2.imdecode(np.frombuffer(data, np.uint8, offset=4 + length), cv2.IMREAD_COLOR)
                number = state['number']
                self._drawn.append((int(state['stamp']), time.time()))


def make_viewer(*, with_browser: bool) -> Browser | Client:
    """Return a browser where there is one."""
    there = importlib.util.find_spec('selenium') is not None and all(
        map(shutil.which, ('chromium', 'chromedriver')))
    return Browser() if with_browser and there else Client()


class Camera(Node):
    """Shows a scene to and fro, has its target followed, and notes what the tracker says."""

    def __init__(self) -> None:
        super().__init__('camera')
        frames = [frame for frame, _ in zip(render_scene(SCENE), range(SHOWN))]
        self._frames = [(message_from_image(frame.image), frame.box.as_tuple())
                        for frame in frames + frames[::-1]]
        self._place = 0
        self.told: list[tuple[float, FrameStatus]] = []
        self._images = self.create_publisher(Image, 'image_raw', qos_profile_sensor_data)
        self._starts = self.create_publisher(PolygonStamped, 'init_box_stamped', 10)
        self.create_subscription(DiagnosticArray, 'lmsco_tracker/status', self._on_status, 10)
        self.create_timer(1 / RATE, self._expose)

    @property
    def is_followed(self) -> bool:
        """Whether the target is tracked."""
        return bool(self.told) and self.told[-1][1].state == 'tracking'

    def spin_for(self, seconds: float) -> list[FrameStatus]:
        """Go on for a while, and return what the tracker said in it."""
        begun = time.monotonic()
        while time.monotonic() < begun + seconds:
            rclpy.spin_once(self, timeout_sec=0.1)
        return [status for heard, status in self.told if heard >= begun]

    def _expose(self) -> None:
        message, box = self._frames[self._place % len(self._frames)]
        message.header.stamp = self.get_clock().now().to_msg()
        self._images.publish(message)
        # One start in a second is enough, also where the target was lost.
        if not self.is_followed and self._place % round(RATE) == 0:
            self._starts.publish(polygon_from_box(box, message.header))
        self._place += 1

    def _on_status(self, message: DiagnosticArray) -> None:
        self.told.append((time.monotonic(), status_from_message(message)))


@dataclass
class Turns:
    """What was seen while the page was closed, or while it was open."""

    seconds: float = 0.0
    frames: int = 0
    tracker_ms: list[float] = field(default_factory=list)

    def add(self, seconds: float, statuses: Sequence[FrameStatus]) -> None:
        """Add one turn."""
        self.seconds += seconds
        self.frames += len(statuses)
        self.tracker_ms += [status.tracker_ms for status in statuses
                            if status.state in ('tracking', 'uncertain')]

    @property
    def figures(self) -> tuple[float, float, float]:
        """Answered frames a second, mean time for a frame in ms, frames a second that allows."""
        mean = float(np.mean(self.tracker_ms)) if self.tracker_ms else float('nan')
        return self.frames / self.seconds, mean, 1e3 / mean


def report(name: str, latencies: Sequence[float], closed: Turns, opened: Turns) -> str:
    """
    Return what is printed.

    Parameters
    ----------
    name : str
        Who looked.
    latencies : sequence of float
        From the stamp of an image until it was drawn, in seconds.
    closed, opened : Turns
        Of the tracker, without and with a page.

    """
    median, late = 1e3 * np.percentile(latencies, [50, 95]) if len(latencies) else (np.nan,) * 2
    before, after = closed.figures, opened.figures
    # Of a time, the smaller is the better one.
    ratios = after[0] / before[0], before[1] / after[1], after[2] / before[2]
    words = 'frames answered in a second', 'time for a frame (ms)', 'frames a second it could do'
    return (f'Camera to drawn frame, {len(latencies)} frames, {name}: median {median:.1f} ms, '
            f'95th percentile {late:.1f} ms\n\n' + markdown_table(
                ('tracker', 'page closed', 'page open', 'open over closed'),
                list(zip(words, before, after, ratios))))


@contextlib.contextmanager
def program(module: str, *arguments: str, **options: Any) -> Iterator[subprocess.Popen]:
    """Run a program of the package beside this one."""
    process = subprocess.Popen([sys.executable, '-m', module, *arguments], **options)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


@contextlib.contextmanager
def programs() -> Iterator[str]:
    """Run tracker and console, and give the address of the page."""
    with tempfile.TemporaryFile() as log, program(
            'lmsco_ros.node.main', stderr=subprocess.DEVNULL), program(
            'lmsco_ros.console.main', '--ros-args', '-p', 'port:=0', stderr=log) as console:
        deadline = time.monotonic() + PATIENCE_SECONDS
        while True:
            log.seek(0)
            told = log.read().decode(errors='replace')
            found = re.search(r'the page is at (http://\S+/)', told)
            if found:
                break
            if console.poll() is not None or time.monotonic() > deadline:
                raise SystemExit(f'the console does not start: {told}')
            time.sleep(0.05)
        yield found[1]


def measure(viewer: Viewer, seconds: float, turns: int) -> str:
    """Let the page be closed and open in turns, and return what is printed."""
    closed, opened, latencies = Turns(), Turns(), []
    with programs() as address:
        camera = Camera()
        deadline = time.monotonic() + PATIENCE_SECONDS
        while not camera.is_followed:
            if time.monotonic() > deadline:
                raise SystemExit('the tracker does not follow the target')
            rclpy.spin_once(camera, timeout_sec=0.1)
        for turn in range(turns):
            # Neither is always the first one.
            for is_open in ((False, True), (True, False))[turn % 2]:
                if is_open:
                    viewer.open(address)
                camera.spin_for(WARM_UP_SECONDS)
                begun = time.time()
                (opened if is_open else closed).add(seconds, camera.spin_for(seconds))
                if is_open:
                    latencies += [drawn - stamp / 1e9 for stamp, drawn in viewer.close()
                                  if stamp / 1e9 >= begun]
        camera.destroy_node()
    return report(viewer.name, latencies, closed, opened)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seconds', type=float, default=20.0, help='of each turn')
    parser.add_argument('--turns', type=int, default=4, help='with the page, and as many without')
    parser.add_argument('--no-browser', action='store_true', help='use a WebSocket client')
    options = parser.parse_args(arguments)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(PROFILE))
    viewer = make_viewer(with_browser=not options.no_browser)
    rclpy.init()
    try:
        print(measure(viewer, options.seconds, options.turns))
    finally:
        viewer.quit()
        rclpy.shutdown()


if __name__ == '__main__':
    main()
