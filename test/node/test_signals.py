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


"""The process ends on a signal: soon, with code 0, without a traceback."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import threading

import pytest

from lmsco_ros.node.tracker_node import main

REPOSITORY = Path(__file__).resolve().parents[2]
# Generous for a machine under load; the node itself aims at one second.
PATIENCE = 10.0
READY = 'waiting for images'


def launch(*arguments):
    """Start the node as a process of its own and wait until it is active."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'lmsco_ros.node.tracker_node', *arguments], cwd=REPOSITORY,
        env={**os.environ, 'RCUTILS_LOGGING_USE_STDOUT': '1'}, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True)
    watchdog = threading.Timer(60, process.kill)
    watchdog.start()
    seen = []
    for line in process.stdout:
        seen.append(line)
        if READY in line:
            break
    watchdog.cancel()
    assert seen and READY in seen[-1], process.communicate()
    return process


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_the_process_cleanly(number):
    process = launch()
    try:
        process.send_signal(number)
        output, errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert 'Traceback' not in output + errors
    assert 'rror' not in output + errors


@pytest.mark.parametrize('arguments, word', [
    (['-p', 'frame_policy:=newest'], 'latest, all'),
    (['-p', 'preset:=best'], 'default'),
    (['-p', 'threads:=many'], 'threads'),
])
def test_wrong_parameters_end_main_with_a_reason(capfd, arguments, word):
    assert main(['--ros-args', *arguments]) == 1
    errors = capfd.readouterr().err
    assert word in errors and 'Traceback' not in errors


def test_collections_do_not_go_through_the_libraries():
    """A full collection while running would take as long as several frames."""
    code = ('import gc, rclpy; from lmsco_ros.node import tracker_node; rclpy.init(); '
            'tracker_node._run([2]); print(gc.get_freeze_count(), len(gc.get_objects()))')
    process = subprocess.run([sys.executable, '-c', code], cwd=REPOSITORY, capture_output=True,
                             text=True, timeout=60, check=True)
    frozen, others = map(int, process.stdout.split()[-2:])
    assert frozen > 100_000 and frozen > 10 * others
