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

"""A command that is ended keeps what it has done, says so, and is quiet otherwise."""

import csv
import os
from pathlib import Path
import pty
import re
import signal
import subprocess
import sys

import cv2
import pytest

PATIENCE_SECONDS = 100.0
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
by_name = pytest.mark.parametrize('number', SIGNALS, ids=lambda number: number.name)


def rows_in(folder):
    """Return the rows of the table so far, which must be whole."""
    path = folder / 'boxes.csv'
    if not path.exists():
        return []
    text = path.read_text()
    assert not text or text.endswith('\n')
    return list(csv.reader(text.splitlines()))[1:]


@pytest.fixture
def tracking(lmsco_process, tmp_path, endless_folder, start, until):
    """Return a function that starts a process and returns it once there are some rows."""
    def begin(**options):
        process = lmsco_process('track', endless_folder, '--init', start, '--output',
                                tmp_path / 'run', **options)
        until(lambda: len(rows_in(tmp_path / 'run')) > 30)
        return process
    return begin


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=['SIGINT', 'SIGTERM'])
def test_signal_keeps_what_was_tracked_and_says_so(tracking, tmp_path, number):
    process = tracking()
    process.send_signal(number)
    _, complaints = process.communicate(timeout=PATIENCE_SECONDS)
    assert process.returncode == 128 + number
    rows = rows_in(tmp_path / 'run')
    assert [int(row[0]) for row in rows] == list(range(len(rows)))
    kept, ended = complaints.splitlines()[-2:]
    assert kept == (f'note: kept in {tmp_path / "run"}: boxes.csv with {len(rows)} rows, '
                    'overlay.mp4, summary.png')
    assert ended == f'ended by {number.name}' and 'Traceback' not in complaints
    film = cv2.VideoCapture(str(tmp_path / 'run' / 'overlay.mp4'))
    assert len(rows) - 1 <= film.get(cv2.CAP_PROP_FRAME_COUNT) <= len(rows)
    assert cv2.imread(str(tmp_path / 'run' / 'summary.png')) is not None


def test_killed_process_leaves_its_rows(tracking, tmp_path):
    process = tracking()
    process.kill()
    process.wait(PATIENCE_SECONDS)
    rows = rows_in(tmp_path / 'run')
    assert len(rows) > 30 and all(len(row) == 10 for row in rows)


def test_closed_terminal_ends_the_command_as_a_signal_does(tracking, tmp_path):
    ours, theirs = pty.openpty()
    process = tracking(stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True,
                       preexec_fn=lambda: os.close(os.open(os.ttyname(0), os.O_RDWR)))
    os.close(theirs)
    os.close(ours)
    assert process.wait(PATIENCE_SECONDS) == 128 + signal.SIGHUP
    assert (tmp_path / 'run' / 'summary.png').exists()


STUBBORN = """
import signal, sys, time
from lmsco_ros.cli.interruption import ended_by_signals
with ended_by_signals():
    try:
        print('working', flush=True)
        time.sleep(600)
    finally:
        print('unwinding', flush=True)
        {unwind}
"""


@pytest.fixture
def stubborn():
    """Return a function that starts a process that works, and unwinds by given statements."""
    started = []

    def start(unwind, **options):
        process = subprocess.Popen([sys.executable, '-c', STUBBORN.format(unwind=unwind)],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   **options)
        started.append(process)
        assert process.stdout.readline() == 'working\n'
        return process
    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_second_signal_ends_at_once(stubborn, until):
    process = stubborn('time.sleep(600)')
    process.send_signal(signal.SIGINT)
    assert process.stdout.readline() == 'unwinding\n'

    def ended():
        process.send_signal(signal.SIGINT)
        return process.poll() is not None
    until(ended)
    assert process.wait(PATIENCE_SECONDS) == 128 + signal.SIGINT
    assert process.stderr.read() == ''


@by_name
def test_signal_that_is_sent_twice_counts_once(stubborn, number):
    """`timeout` sends it to the process and to its group."""
    process = stubborn('signal.raise_signal(signal.SIGTERM); print("unwound", flush=True)')
    process.send_signal(number)
    words, complaints = process.communicate(timeout=PATIENCE_SECONDS)
    assert words == 'unwinding\nunwound\n' and complaints == f'ended by {number.name}\n'
    assert process.returncode == 128 + number


def test_error_that_a_signal_leads_to_is_the_signal(stubborn):
    """Imports that are broken off may fail with errors of their own."""
    process = stubborn('raise ImportError("a part of a library is missing")')
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=PATIENCE_SECONDS)[1] == 'ended by SIGTERM\n'
    assert process.returncode == 128 + signal.SIGTERM


def test_ignored_signal_stays_ignored(stubborn):
    """As `nohup` has it."""
    process = stubborn('pass', preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    process.send_signal(signal.SIGHUP)
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE_SECONDS) == 128 + signal.SIGTERM


@by_name
def test_signal_during_the_imports_is_quiet(number, tmp_path):
    """A module that is imported first and never gets done stands for the slow ones."""
    (tmp_path / 'typer.py').write_text(
        'import time\nprint("importing", flush=True)\ntime.sleep(600)\n')
    process = subprocess.Popen(
        [sys.executable, '-m', 'lmsco_ros.cli.main', '--help'], text=True,
        env={**os.environ, 'PYTHONPATH': f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}'},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == 'importing\n'
    process.send_signal(number)
    assert process.communicate(timeout=PATIENCE_SECONDS)[1] == f'ended by {number.name}\n'
    assert process.returncode == 128 + number


def ignores(process, number):
    """Tell whether a process of this machine ignores a signal."""
    try:
        status = Path(f'/proc/{process}/status').read_text()
    except OSError:
        return False
    return int(re.search(r'SigIgn:\s*(\w+)', status)[1], 16) >> (number - 1) & 1 == 1


def test_evaluation_that_is_ended_counts_no_crash(lmsco_process, tmp_path, endless_folder, start,
                                                  until):
    """The signal reaches the workers as well, as from a terminal that is closed."""
    sequence = tmp_path / 'data' / 'sequence'
    sequence.mkdir(parents=True)
    (sequence / 'img').symlink_to(endless_folder)
    count = len(list(endless_folder.iterdir()))
    (sequence / 'groundtruth_rect.txt').write_text(f'{start}\n' * count)
    log = tmp_path / 'evaluation.log'
    with log.open('w') as told:
        process = lmsco_process('evaluate', tmp_path / 'data', '--tracker', 'hcs', '--output',
                                tmp_path / 'run', stdout=told, stderr=told,
                                start_new_session=True)
        children = Path(f'/proc/{process.pid}/task/{process.pid}/children')
        until(lambda: any(ignores(child, signal.SIGHUP)
                          for child in children.read_text().split()))
        os.killpg(process.pid, signal.SIGTERM)
        assert process.wait(PATIENCE_SECONDS) == 128 + signal.SIGTERM
    assert 'the same command goes on from there\nended by SIGTERM\n' in log.read_text()
    assert not list(tmp_path.glob('run/records/**/*.json'))


def test_demo_keeps_what_was_answered(lmsco_process, tmp_path, until):
    pytest.importorskip('rclpy', reason='needs ROS 2')
    process = lmsco_process('demo', '--width', 160, '--height', 128, '--frames', 1500,
                            '--output', tmp_path / 'run')
    until(lambda: len(rows_in(tmp_path / 'run')) > 10 or process.poll() is not None)
    process.send_signal(signal.SIGTERM)
    _, complaints = process.communicate(timeout=PATIENCE_SECONDS)
    assert process.returncode == 128 + signal.SIGTERM and 'Traceback' not in complaints
    rows = rows_in(tmp_path / 'run')
    assert (f'kept in {tmp_path / "run"}: boxes.csv with {len(rows)} rows, overlay.mp4, '
            'summary.png') in complaints
