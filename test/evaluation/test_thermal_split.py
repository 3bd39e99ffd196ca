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

"""The split of the project's own sequences, and the measures that chose it."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from benchmarks.split_selection import (
    clutter_around, Difficulty, hardest, main, measure, split_content)
from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.split import load_split

SPLIT = Path(__file__).resolve().parents[2] / 'benchmarks' / 'thermal_dev.yaml'


def test_the_parts_are_disjoint_and_of_the_stated_size():
    split = load_split(SPLIT)
    test, train = split.parts['test'], split.parts['train']
    assert not test & train
    assert sum(name.startswith('drone_ir/') for name in test) == 40
    assert {name.split('/')[0] for name in train} == {'drone_ir'}
    assert not any('lepton' in name for name in test | train)
    groups = {name.split('/')[0] for name in test}
    assert groups == set(split.scenes['ground-level']) | set(split.scenes['aerial'])


def test_every_real_sequence_is_in_one_part(thermal_dev):
    names = {sequence.full_name for sequence in scan_dataset(thermal_dev).sequences}
    split = load_split(SPLIT)
    assert split.parts['test'] | split.parts['train'] == names


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


def test_a_new_selection_keeps_what_the_file_says_of_the_data(tmp_path, vot_folder, capsys):
    for group in ('vot_tir', 'ptb_tir', 'anti_uav_ir', 'drone_ir'):
        vot_folder(tmp_path / group / 'clip', [0] * 4)
    (tmp_path / 'drone_ir' / 'summary.csv').write_text('name,frames_several_targets\nclip,0\n')
    main(tmp_path)
    made = yaml.safe_load(capsys.readouterr().out)
    assert made['about'] == load_split(SPLIT).about
    assert made['parts']['test']['drone_ir'] == ['clip']
