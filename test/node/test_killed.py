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


"""Processes that die without a word: the camera under the node, the node under the camera."""

import os
from pathlib import Path
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
import pytest
from sensor_msgs.msg import Image, RegionOfInterest

from msg_adapters.status import Level, status_from_message

REPOSITORY = Path(__file__).resolve().parents[2]
CAMERA = Path(__file__).with_name('camera_process.py')


@pytest.fixture
def processes():
    """Return a list of processes that are killed in the end."""
    processes = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


def start(graph, processes, *command):
    profile = REPOSITORY / 'config' / 'fastdds_large_images.xml'
    process = subprocess.Popen(
        [sys.executable, *command, '--ros-args', '-r', f'__ns:={graph.namespace}'],
        cwd=REPOSITORY, stdin=subprocess.PIPE, text=True, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(profile)})
    processes.append(process)
    return process


def start_camera(graph, processes):
    camera = start(graph, processes, str(CAMERA), '100000')
    camera.stdin.write('go\n')
    camera.stdin.flush()
    return camera


def test_node_goes_on_with_a_new_camera_after_one_was_killed(own_graph, processes):
    own_graph.start_tracker(no_image_timeout=0.5)
    statuses = own_graph.listen(DiagnosticArray, 'lmsco_tracker/status')
    boxes = own_graph.listen(PolygonStamped, 'lmsco_tracker/box')
    health = own_graph.listen(DiagnosticArray, '/diagnostics')
    own_graph.publisher(RegionOfInterest, 'init_box').publish(
        RegionOfInterest(x_offset=300, y_offset=200, width=40, height=30))
    own_graph.settle()
    camera = start_camera(own_graph, processes)
    own_graph.spin_until(lambda: len(boxes) > 5)
    camera.kill()
    camera.wait()
    # Before the first image there was silence as well; what is on its way may tell of that.
    told = len(health)
    own_graph.spin_until(lambda: len(health) > told + 1
                         and health[-1].status[0].level == bytes([Level.STALE]))
    # Every image has its box, and no box is repeated.
    own_graph.spin_until(lambda: [box.header for box in boxes]
                         == [status.header for status in statuses])
    count = len(boxes)
    start_camera(own_graph, processes)
    own_graph.spin_until(lambda: len(boxes) > count + 5 and len(statuses) > count + 5)
    answers = map(status_from_message, statuses)
    assert {(answer.state, answer.track_id) for answer in answers} == {('tracking', 1)}
    stamps = [(box.header.stamp.sec, box.header.stamp.nanosec) for box in boxes]
    assert stamps == sorted(set(stamps))


def test_camera_is_answered_by_a_new_node_after_one_was_killed(own_graph, processes):
    node = start(own_graph, processes, '-m', 'lmsco_ros.node.main')
    images = own_graph.publisher(Image, 'image_raw')
    statuses = own_graph.listen(DiagnosticArray, 'lmsco_tracker/status')
    boxes = own_graph.listen(PolygonStamped, 'lmsco_tracker/box', connected=False)

    def answered():
        images.publish(own_graph.image(shape=(96, 128)))
        return len(statuses) > 3
    own_graph.spin_until(answered)
    node.kill()
    node.wait()
    for _ in range(20):
        images.publish(own_graph.image(shape=(96, 128)))
        own_graph.executor.spin_once(timeout_sec=0.01)
    statuses.clear()
    start(own_graph, processes, '-m', 'lmsco_ros.node.main')
    own_graph.spin_until(answered)
    # It knows of no target, and says nothing of images that it has not seen.
    assert {status_from_message(message).state for message in statuses} == {'idle'}
    assert not boxes
