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

"""The folder of a run holds table, film and summary."""

import csv

import cv2
import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.results_file import BoxesFile
from lmsco_ros.replay.run_outputs import RunOutputs


def result(state=TrackState.TRACKING):
    box = BoundingBox(20.25, 10, 12, 16)
    return TrackResult(box, 0.8125, state, np.zeros((4, 4), np.float32), box)


def test_rows_are_exact_and_lost_ones_have_no_box(tmp_path):
    with BoxesFile(tmp_path / 'boxes.csv') as file:
        file.add(0, 1_700_000_000_000_000_007, result())
        file.add(1, 1_700_000_000_040_000_007, result(TrackState.LOST))
    with (tmp_path / 'boxes.csv').open() as stream:
        first, second = csv.DictReader(stream)
    assert first == {
        'frame': '0', 'stamp': '1700000000.000000007', 'x': '20.250', 'y': '10.000',
        'width': '12.000', 'height': '16.000', 'score': '0.8125', 'state': 'tracking'}
    assert second['x'] == second['height'] == '' and second['state'] == 'lost'


def test_all_outputs_are_written(tmp_path, frames):
    with RunOutputs(tmp_path / 'a' / 'run', 25, 'a run') as outputs:
        for frame in frames:
            outputs.add(frame, result(), BoundingBox(20, 10, 12, 16))
    files = {path.name for path in (tmp_path / 'a' / 'run').iterdir()}
    assert files == {'boxes.csv', 'overlay.mp4', 'summary.png'}
    assert len((tmp_path / 'a' / 'run' / 'boxes.csv').read_text().splitlines()) == 11
    film = cv2.VideoCapture(str(tmp_path / 'a' / 'run' / 'overlay.mp4'))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 10


def test_what_was_tracked_before_an_error_is_kept(tmp_path, frames):
    with pytest.raises(RuntimeError):
        with RunOutputs(tmp_path / 'run', 25, 'a run') as outputs:
            outputs.add(frames[0], result())
            raise RuntimeError
    assert (tmp_path / 'run' / 'summary.png').stat().st_size > 1000


def test_place_that_cannot_be_written_to(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(OutputError, match='cannot be written to'):
        RunOutputs(tmp_path / 'file' / 'run', 25, 'a run')
