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

"""`lmsco demo`: the whole chain on a small scene."""

import csv
import re
import shutil

import cv2
import pytest


def test_demo_tracks_writes_and_measures(lmsco, tmp_path):
    outcome = lmsco('demo', '--output', tmp_path / 'demo', '--frames', 60, '--width', 160,
                    '--height', 128)
    assert outcome.exit_code == 0, outcome.output
    answered = re.search(r'frames answered +(\d+) of 60', outcome.output)
    assert answered and int(answered[1]) >= 2
    overlap = re.search(r'mean overlap +(\d\.\d+)', outcome.output)
    assert overlap and 0 < float(overlap[1]) <= 1
    hidden = re.search(r'said lost while hidden +(\d+) of (\d+) frames', outcome.output)
    assert hidden and int(hidden[1]) <= int(hidden[2]) < int(answered[1])
    for words in ('found again after', 'precision at 5 px / 20 px', 'latency, image to box',
                  'p95'):
        assert words in outcome.words
    with (tmp_path / 'demo' / 'boxes.csv').open() as stream:
        assert len(list(csv.DictReader(stream))) == int(answered[1])
    assert cv2.imread(str(tmp_path / 'demo' / 'summary.png')) is not None
    film = cv2.VideoCapture(str(tmp_path / 'demo' / 'overlay.mp4'))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == int(answered[1])


def test_unknown_preset(lmsco, tmp_path):
    outcome = lmsco('demo', '--preset', 'nope', '--output', tmp_path)
    assert outcome.exit_code == 2 and 'nope' in outcome.words


def test_real_clip_is_shown_to_the_node(lmsco, tmp_path, scene_folder, start):
    outcome = lmsco('demo', '--source', scene_folder, '--init', start, '--frames', 12,
                    '--output', tmp_path / 'clip')
    assert outcome.exit_code == 0, outcome.output
    assert re.search(r'frames answered +\d+ of 12', outcome.output)
    assert 'latency, image to box' in outcome.words and 'overlap' not in outcome.words
    with (tmp_path / 'clip' / 'boxes.csv').open() as stream:
        row = next(csv.DictReader(stream))
    assert float(row['stamp']) == 0
    assert [float(row[key]) for key in ('x', 'y')] == pytest.approx(
        [float(number) for number in start.split(',')[:2]], abs=3)


@pytest.mark.parametrize('half', ['--source', '--init'])
def test_clip_and_target_come_together(lmsco, tmp_path, scene_folder, half):
    value = {'--source': scene_folder, '--init': '1,2,30,40'}[half]
    outcome = lmsco('demo', half, value, '--output', tmp_path / 'never')
    assert outcome.exit_code == 2 and 'give --source and --init x,y,w,h' in outcome.words
    assert not (tmp_path / 'never').exists()


def test_clip_of_one_frame_is_refused(lmsco, tmp_path, scene_folder, start):
    (tmp_path / 'one').mkdir()
    shutil.copy(min(scene_folder.iterdir()), tmp_path / 'one')
    outcome = lmsco('demo', '--source', tmp_path / 'one', '--init', start,
                    '--output', tmp_path / 'never')
    assert outcome.exit_code == 2 and 'has 1 frames' in outcome.words
    assert not (tmp_path / 'never').exists()
