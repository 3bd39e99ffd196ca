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

"""A split in a file of the user: what it selects, and what is said of one that is none."""

import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.errors import RequestError
from lmsco_ros.evaluation.session import describe, Request, select_sequences
from lmsco_ros.evaluation.split import load_split
from lmsco_ros.evaluation.worker_pool import LocalProcesses

SPLIT = """
parts:
  night: {roof: [1, walker], yard: [fox]}
  day: {yard: [owl]}
scenes: {outside: [yard]}
"""


@pytest.fixture
def split(tmp_path):
    """Return the path of a split with two parts."""
    path = tmp_path / 'split.yaml'
    path.write_text(SPLIT, encoding='utf-8')
    return path


def test_a_split_is_read_from_a_file(split):
    found = load_split(split)
    assert found.parts == {'night': {'roof/1', 'roof/walker', 'yard/fox'}, 'day': {'yard/owl'}}
    assert found.scenes == {'outside': ('yard',)} and found.about == ''
    assert found.name == 'split.yaml'


def test_only_the_part_is_evaluated_and_told_without_a_path(tmp_path, split, vot_folder):
    for name in ('roof/walker', 'yard/owl', 'yard/crow'):
        vot_folder(tmp_path / 'data' / name, [0] * 4)
    request = Request(tmp_path / 'data', split=split, part='night')
    selection = select_sequences(request)
    assert [item.full_name for item in selection.sequences] == ['roof/walker']
    told = describe(request, LocalProcesses(1), ())
    assert (told['split'], told['part']) == ('split.yaml', 'night')
    assert 'split' not in describe(Request(tmp_path / 'data'), LocalProcesses(1), ())


@pytest.mark.parametrize('part, reason', [
    ('night', 'no sequence of this dataset'), ('noon', "no part 'noon'; it has day, night")])
def test_a_part_that_is_not_there_is_refused(tmp_path, split, vot_folder, part, reason):
    vot_folder(tmp_path / 'data' / 'other' / 'seq', [0, 0])
    with pytest.raises(RequestError, match=reason):
        load_split(split).select(part, scan_dataset(tmp_path / 'data').sequences)


@pytest.mark.parametrize('text', [
    '', '[1, 2]', '{test: {a: [b]}}', 'parts: [a]', 'parts: {test: [a]}', 'parts: {test: {a: b}}',
    'parts: {test: {a: {b: c}}}', '{parts: {test: {a: [b]}}, scenes: [a]}',
    '{parts: {test: {a: [b]}}, scenes: {a: b}}', 'parts: {', '\x00'])
def test_a_file_that_is_no_split_is_told(tmp_path, text):
    path = tmp_path / 'odd.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(RequestError, match='odd.yaml is no split .*; expected YAML such as'):
        load_split(path)


def test_a_sequence_without_target_in_the_first_frames_is_reported(tmp_path, vot_folder):
    vot_folder(tmp_path / 'here', [0] * 4)
    late = vot_folder(tmp_path / 'late', [0] * 4)
    rows = (late / 'groundtruth.txt').read_text(encoding='utf-8').splitlines()
    (late / 'groundtruth.txt').write_text('\n'.join(['nan,nan,nan,nan'] * 2 + rows[2:]),
                                          encoding='utf-8')
    selection = select_sequences(Request(tmp_path, frames=2))
    assert [item.name for item in selection.sequences] == ['here']
    assert 'first 2 frames' in selection.broken[0].reason
    assert len(select_sequences(Request(tmp_path, frames=3)).sequences) == 2
