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

"""A short storm passes over the node without a trace, and one that does not is told."""

from collections import Counter
import sys

import pytest

from benchmarks import storm, storm_members
from benchmarks.storm import Report, storm_table
from benchmarks.storm_members import Counts


def report(**values):
    """Return what a storm without a complaint tells."""
    return Report(**{
        'requests': {'transitions': Counts(9, 9, 5), 'resets': Counts(8, 7, 1)},
        'published': Counter(images=100), 'lives': True, 'answers': True, 'code': 0,
        'faults': 0, 'memory': (200.4, 201.6), **values})


def test_node_lives_through_a_short_storm():
    told = storm.storm(4.0)
    assert not told.complaints, (told, told.last_lines)
    assert set(told.requests) >= {'transitions', 'parameters', 'parameters, together'}
    for name, counts in told.requests.items():
        assert counts.refused > 0 or name in ('resets', 'pauses')
    assert told.published['images'] > 0 and told.published['starts'] > 0
    assert all(memory > 0 for memory in told.memory)


def test_process_that_ends_is_told(monkeypatch):
    monkeypatch.setattr(storm_members, 'PATIENCE_SECONDS', 0.1)
    told = storm.storm(0.2, command=[
        sys.executable, '-c', 'raise RuntimeError("wrong")'])
    assert not told.lives and not told.answers and 'wrong' in told.last_lines
    assert told.tracebacks == 1 and told.code == 1
    assert 'the process ended' in told.complaints


@pytest.mark.parametrize('values, word', [
    ({}, ''), ({'lives': False}, 'the process ended'), ({'answers': False}, 'no image'),
    ({'code': -6}, 'code -6'), ({'code': None}, 'code None'), ({'faults': 2}, '2 faults'),
    ({'tracebacks': 1}, '1 tracebacks'),
    ({'requests': {'parameters': Counts(3, 2, 1)}}, "{'parameters': 1}")])
def test_complaints_name_what_should_not_have_happened(values, word):
    complaints = report(**values).complaints
    assert word in complaints[0] if word else not complaints


def test_table_tells_what_was_sent_and_what_became_of_the_process():
    table, words = storm_table(report()).split('\n\n')
    rows = [[cell.strip() for cell in line.split('|')[1:-1]] for line in table.splitlines()[2:]]
    assert rows == [['resets', '8', '7', '1', '1'], ['transitions', '9', '9', '5', '0'],
                    ['images', '100', '–', '–', '–']]
    assert 'lived and answers images' in words and '200 MiB' in words and '202 MiB' in words
    assert 'ended and does not answer' in storm_table(report(lives=False, answers=False))


@pytest.mark.parametrize('faults, code', [(0, 0), (1, 1)])
def test_complaints_show_in_the_exit_code(monkeypatch, tmp_path, capsys, faults, code):
    monkeypatch.setattr(storm, 'storm', lambda seconds, **options: report(faults=faults))
    page = tmp_path / 'page.md'
    page.write_text('<!-- storm -->\nold\n<!-- /storm -->\n')
    assert storm.main(['--seconds', '1', '--page', str(page)]) == code
    assert '| transitions | 9' in page.read_text() and 'old' not in page.read_text()
    assert ('1 faults' in capsys.readouterr().err) == bool(code)
