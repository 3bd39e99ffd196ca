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


"""The process ends on a signal: soon, with code 0, without a traceback, whatever it is at."""

import gc
import os
from pathlib import Path
import signal
import subprocess
import sys
import threading

import pytest
from sensor_msgs.msg import Image, RegionOfInterest

from lmsco_ros.node.run import run

REPOSITORY = Path(__file__).resolve().parents[2]
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
# Generous for a machine under load; the process itself aims at one second.
PATIENCE = 100.0
READY = 'waiting for images'
# The real process around something else than the node.
PROCESS = """
import sys, threading, time, types

def run(arguments, ending):
    print('running', flush=True)
    {body}

sys.modules['lmsco_ros.node.run'] = types.SimpleNamespace(run=run)
from lmsco_ros.node.main import main
main()
"""
# The real node, with a tracker that never comes back; imported when signals are heeded.
STUCK_TRACKER = """
    from unittest.mock import Mock
    del sys.modules['lmsco_ros.node.run']
    from lmsco_ros.node import run as real

    def initialize(image, box, time, in_place_of):
        print('stuck', flush=True)
        while True:
            pass

    TrackerNode = real.TrackerNode
    real.TrackerNode = lambda: TrackerNode(
        tracker_factory=lambda settings: Mock(initialize=initialize, results={}))
    return real.run(arguments, ending)
"""


@pytest.fixture
def start():
    """Return a function that starts Python with the project as a process of its own."""
    processes, watchdogs = [], []

    def run(*arguments, **options):
        environment = {**os.environ, 'RCUTILS_LOGGING_USE_STDOUT': '1',
                       'PYTHONPATH': str(REPOSITORY), **options.pop('environment', {})}
        process = subprocess.Popen(
            [*options.pop('prefix', []), sys.executable, *arguments], cwd=REPOSITORY,
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            **options)
        watchdogs.append(threading.Timer(2 * PATIENCE, process.kill))
        watchdogs[-1].start()
        processes.append(process)
        return process
    yield run
    for process, watchdog in zip(processes, watchdogs):
        watchdog.cancel()
        process.kill()
        process.communicate()


def wait_for(process, word):
    """Read what the process says until a line with a word comes."""
    seen = []
    for line in process.stdout:
        seen.append(line)
        if word in line:
            return
    pytest.fail(f'the process ended without {word}: {seen} {process.stderr.read()}')


def ends_cleanly(process, number):
    """Send a signal and check how the process ends."""
    process.send_signal(number)
    output, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    assert 'Traceback' not in output + errors and 'rror' not in output + errors


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_the_process_cleanly(start, number):
    process = start('-m', 'lmsco_ros.node.main')
    wait_for(process, READY)
    ends_cleanly(process, number)


@pytest.mark.parametrize('number', SIGNALS)
def test_signal_during_the_imports_ends_the_process(start, tmp_path, number):
    (tmp_path / 'rclpy.py').write_text(
        "print('importing', flush=True)\nimport time\ntime.sleep(3600)\n")
    process = start('-m', 'lmsco_ros.node.main',
                    environment={'PYTHONPATH': f'{tmp_path}:{REPOSITORY}'})
    wait_for(process, 'importing')
    ends_cleanly(process, number)


@pytest.mark.parametrize('number', SIGNALS)
def test_signal_that_waits_from_the_very_start_is_heeded(start, number):
    """Signals that were blocked outside are not lost, and the mask outlives every exec."""
    process = start('-m', 'lmsco_ros.node.main',
                    preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS))
    ends_cleanly(process, number)


@pytest.mark.parametrize('number', SIGNALS)
def test_each_signal_tells_the_node_to_end(start, number):
    process = start('-c', PROCESS.format(body='ending.wait(); return 0'))
    wait_for(process, 'running')
    ends_cleanly(process, number)


@pytest.mark.parametrize('body', [
    'time.sleep(3600)', 'threading.Lock().acquire() and threading.Event().wait()',
    'while True: pass', 'ending.wait() and time.sleep(3600)',
], ids=['sleeps', 'waits', 'counts', 'does not come back from its clean-up'])
def test_nothing_that_never_returns_keeps_the_process_alive(start, body):
    process = start('-c', PROCESS.format(body=body))
    wait_for(process, 'running')
    ends_cleanly(process, signal.SIGTERM)


def test_tracker_that_never_returns_does_not_keep_the_process_alive(start, own_graph):
    process = start('-c', PROCESS.format(body=STUCK_TRACKER),
                    '--ros-args', '-r', f'__ns:={own_graph.namespace}')
    wait_for(process, READY)
    images = own_graph.publisher(Image, 'image_raw')
    boxes = own_graph.publisher(RegionOfInterest, 'init_box')
    heard = threading.Event()
    threading.Thread(target=lambda: (wait_for(process, 'stuck'), heard.set())).start()

    def is_stuck():
        images.publish(own_graph.image())
        boxes.publish(RegionOfInterest(x_offset=10, y_offset=12, width=8, height=6))
        return heard.is_set()
    own_graph.spin_until(is_stuck)
    ends_cleanly(process, signal.SIGINT)


def test_error_while_ending_is_told_in_one_line(start):
    process = start('-c', PROCESS.format(body='ending.wait(); raise OSError("gone\\nat line 3")'))
    wait_for(process, 'running')
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (0, 'tracker_node: while ending: OSError: gone\n')


def test_other_errors_are_told_in_full(start):
    process = start('-c', PROCESS.format(body='raise OSError("gone")'))
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1 and errors.startswith('Traceback') and 'OSError: gone' in errors


@pytest.mark.parametrize('prefix, heeded', [([], 'True'), (['nohup'], 'False')])
def test_hang_up_is_heeded_unless_it_is_ignored(start, prefix, heeded):
    process = start('-c', PROCESS.format(
        body='import signal; print(signal.SIGHUP in signal.pthread_sigmask('
             'signal.SIG_BLOCK, []), flush=True); return 0'), prefix=prefix)
    output, errors = process.communicate(timeout=PATIENCE)
    assert output.split() == ['running', heeded], errors


def test_collections_do_not_go_through_the_libraries():
    """A full collection while running would take as long as several frames."""
    ended = threading.Event()
    ended.set()
    try:
        run([], ended)
        frozen, others = gc.get_freeze_count(), len(gc.get_objects())
    finally:
        gc.unfreeze()
    assert frozen > 100_000 and frozen > 10 * others
