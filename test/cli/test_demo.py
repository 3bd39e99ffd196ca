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

import cv2


def test_demo_tracks_writes_and_measures(lmsco, tmp_path):
    outcome = lmsco('demo', '--output', tmp_path / 'demo', '--frames', 60, '--width', 160,
                    '--height', 128)
    assert outcome.exit_code == 0, outcome.output
    answered = re.search(r'frames answered +(\d+) of 60', outcome.output)
    assert answered and int(answered[1]) >= 2
    overlap = re.search(r'mean overlap +(\d\.\d+)', outcome.output)
    assert overlap and 0 < float(overlap[1]) <= 1
    for words in ('precision at 5 px / 20 px', 'latency, image to box', 'p95'):
        assert words in outcome.words
    with (tmp_path / 'demo' / 'boxes.csv').open() as stream:
        assert len(list(csv.DictReader(stream))) == int(answered[1])
    assert cv2.imread(str(tmp_path / 'demo' / 'summary.png')) is not None
    film = cv2.VideoCapture(str(tmp_path / 'demo' / 'overlay.mp4'))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == int(answered[1])


def test_unknown_preset(lmsco, tmp_path):
    outcome = lmsco('demo', '--preset', 'nope', '--output', tmp_path)
    assert outcome.exit_code == 2 and 'nope' in outcome.words
