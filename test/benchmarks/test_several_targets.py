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

"""Answers with several targets are counted and timed beside those with one."""

import pytest

from benchmarks import several_targets
from benchmarks.several_targets import Answers, COLUMNS, measure, report


def rows(text):
    """Return the cells of the table."""
    return [[cell.strip() for cell in line.split('|')[1:-1]]
            for line in text.splitlines() if line.startswith('|')]


def test_two_processes_answer_every_number_in_turn():
    answers = measure([1, 3], frames=10, rounds=2)
    for told in answers.values():
        # A busy machine drops frames, and never sends more than were asked for by much.
        assert 20 <= told.sent < 40 and 0 < len(told.latencies) <= told.sent
        assert len(told.tracker_ms) == len(told.latencies) and told.tracking <= told.sent
        assert all(own < whole for own, whole in zip(told.tracker_ms, told.latencies))


@pytest.mark.parametrize('sent, latencies, words', [
    (4, [10, 10, 10, 14], []),
    (5, [10, 10, 10, 14], ['only 0.800 of the frames']),
    (4, [10, 10, 20, 20], ['the latency is 2.00 times as long']),
    (4, [], ['only 0.000', 'the latency is nan'])])
def test_missed_aims_are_told(sent, latencies, words):
    one = Answers(4, [10.0] * 4, [4.0] * 4, 4)
    text, missed = report({3: Answers(sent, latencies, [5.0] * len(latencies), 2), 1: one})
    assert len(missed) == len(words) and all(
        word in aim for word, aim in zip(words, missed))
    header, _, first, last = rows(text)
    assert header == list(COLUMNS) and first[:2] == ['1', '4'] and last[:2] == ['3', str(sent)]
    assert first[6] == '1.00' and 'With 3 targets' in text


@pytest.mark.parametrize('latency, code', [(11.0, 0), (30.0, 1)])
def test_table_goes_into_the_page(monkeypatch, tmp_path, capsys, latency, code):
    monkeypatch.setattr(several_targets, 'measure', lambda numbers, frames, rounds: {
        number: Answers(2, [latency if number > 1 else 10.0] * 2, [1.0, 1.0], 2)
        for number in numbers})
    page = tmp_path / 'page.md'
    page.write_text('<!-- several-targets -->\nold\n<!-- /several-targets -->\n')
    assert several_targets.main(['--targets', '1', '2', '--page', str(page)]) == code
    assert '| 2 | 2 | 1.00 |' in page.read_text() and 'old' not in page.read_text()
    assert ('times as long' in capsys.readouterr().err) == bool(code)
