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

"""The fixed split, and the measures that chose it."""

import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.session import Request, select_sequences
from lmsco_ros.evaluation.split import load_split
from lmsco_ros.evaluation.split_selection import (
    clutter_around, Difficulty, hardest, measure, split_content)


def test_the_parts_are_disjoint_and_of_the_stated_size():
    split = load_split()
    test, train = split.parts['test'], split.parts['train']
    assert not test & train
    assert sum(name.startswith('drone_ir/') for name in test) == 40
    assert {name.split('/')[0] for name in train} == {'drone_ir'}
    assert not any('lepton' in name for name in test | train)
    groups = {name.split('/')[0] for name in test}
    assert groups == set(split.scenes['ground-level']) | set(split.scenes['aerial'])


def test_every_real_sequence_is_in_one_part(thermal_dev):
    names = {sequence.full_name for sequence in scan_dataset(thermal_dev).sequences}
    split = load_split()
    assert split.parts['test'] | split.parts['train'] == names


def test_selecting_a_part_of_another_dataset_is_refused(tmp_path, vot_folder):
    vot_folder(tmp_path / 'other' / 'seq', [0, 0])
    sequences = scan_dataset(tmp_path).sequences
    with pytest.raises(DatasetError, match='no sequence'):
        load_split().select('test', sequences)
    with pytest.raises(DatasetError, match='test, train'):
        load_split().select('validation', sequences)


def test_the_hardest_of_each_criterion_are_taken_in_turn():
    clips = {'fast': Difficulty(9, 1, 1), 'growing': Difficulty(1, 9, 1),
             'hidden': Difficulty(1, 1, 9), 'easy': Difficulty(2, 2, 2),
             'plain': Difficulty(0, 0, 0)}
    assert hardest(clips, 3) == ['fast', 'growing', 'hidden']
    assert hardest(clips, 4) == ['easy', 'fast', 'growing', 'hidden']


def test_measures_of_a_steady_target(tmp_path, vot_folder):
    boxes = [(10 + 2 * index, 10, 4, 4) for index in range(10)]
    vot_folder(tmp_path / 'seq', [0] * 10, boxes)
    difficulty = measure(scan_dataset(tmp_path).sequences[0])
    assert difficulty.motion == pytest.approx(2 / 4)
    assert difficulty.size_change == pytest.approx(1)
    assert difficulty.clutter == pytest.approx(0)


def test_clutter_is_spread_around_the_target_by_contrast():
    image = np.full((40, 40), 100, np.uint8)
    image[:, ::2] = 120
    image[16:24, 16:24] = 160
    # The ring has half its pixels at 100 and half at 120: mean 110, deviation 10.
    assert clutter_around(image, np.array([16., 16, 8, 8])) == pytest.approx(10 / 50)


def test_clips_with_several_targets_are_left_to_training(tmp_path, vot_folder):
    for group, name in (('vot_tir', 'a'), ('ptb_tir', 'b'), ('anti_uav_ir', 'c'),
                        ('drone_ir', 'd'), ('drone_ir', 'e')):
        vot_folder(tmp_path / group / name, [0] * 4)
    parts = split_content(scan_dataset(tmp_path).sequences, frozenset({'e'}))['parts']
    assert parts['test'] == {'anti_uav_ir': ['c'], 'ptb_tir': ['b'], 'vot_tir': ['a'],
                             'drone_ir': ['d']}
    assert parts['train'] == {'drone_ir': ['e']}


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
