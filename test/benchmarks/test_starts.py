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

"""Starts of the node that are ended at random moments end cleanly, and are counted rightly."""

import signal
import sys

import pytest

from benchmarks import starts
from benchmarks.starts import End, MOMENTS, starts_table

START, TRACK, CHANGE = MOMENTS


def test_every_moment_of_the_node_can_be_ended():
    ends = list(starts.starts(3, command=[
        *starts.HOLD_BACK, sys.executable, '-m', 'lmsco_ros.node.main']))
    assert [end.moment for end in ends] == [START, TRACK, CHANGE]
    assert all(end.clean for end in ends), ends


def test_process_that_does_not_end_well_is_not_taken_for_a_clean_one():
    """It leaves with a traceback, as the interpreter does before anybody minds."""
    code = 'import time; print("ready", flush=True); time.sleep(3600)'
    with starts.subprocess.Popen([sys.executable, '-c', code], text=True, stdout=-1,
                                 stderr=-2) as process:
        assert process.stdout.readline() == 'ready\n'
        end = starts._end(process, signal.SIGINT, START)
    assert (end.code, end.traceback, end.clean) == (-signal.SIGINT, True, False)


def test_table_has_a_row_for_each_moment_and_signal():
    ends = [End(START, signal.SIGINT, 0.1, 0, False), End(START, signal.SIGINT, 0.3, 1, True),
            End(TRACK, signal.SIGTERM, 0.2, -15, False)]
    rows = [[cell.strip() for cell in line.split('|')[1:-1]]
            for line in starts_table(ends).splitlines()[2:]]
    assert rows == [
        [f'SIGINT {START}', '2', '1', '1', '1', '200', '298', '300'],
        [f'SIGTERM {TRACK}', '1', '0', '-15', '0', '200', '200', '200'],
        ['**in all**', '3', '1', '-15, 1', '1', '200', '298', '300']]


@pytest.mark.parametrize('end, code', [
    (End(TRACK, signal.SIGINT, 0.1, 0, False), 0), (End(TRACK, signal.SIGINT, 0.1, 0, True), 1),
    (End(TRACK, signal.SIGINT, 0.1, None, False), 1)])
def test_whatever_is_not_clean_shows_in_the_exit_code(monkeypatch, tmp_path, end, code):
    monkeypatch.setattr(starts, 'starts', lambda count, **options: [end] * count)
    page = tmp_path / 'page.md'
    page.write_text('<!-- starts -->\nold\n<!-- /starts -->\n')
    assert starts.main(['--count', '2', '--page', str(page)]) == code
    assert '**in all** | 2' in page.read_text() and 'old' not in page.read_text()
