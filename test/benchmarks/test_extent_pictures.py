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

"""Pictures of boxes with their deviations, and how many edges lie within them."""

import re

import cv2
import numpy as np
import pytest

from benchmarks import edge_calibration, extent_sheet
from lmsco_ros.core import BoundingBox, TrackResult, TrackState

BOX = BoundingBox(10, 20, 30, 40)


@pytest.fixture
def dataset(tmp_path):
    """Return the folder of a data set with one warm target that moves."""
    place = tmp_path / 'made' / 'walk'
    (place / 'ir').mkdir(parents=True)
    x, y = np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5)
    boxes = []
    for number in range(8):
        center = (60 + 2 * number, 50 + number)
        away = np.hypot((x - center[0]) / 30, (y - center[1]) / 20)
        noise = np.random.default_rng(number).normal(0, 2, x.shape)
        image = 100 + 90 / (1 + np.exp(30 * (away - 0.5))) + noise
        cv2.imwrite(str(place / 'ir' / f'{number:03d}.png'), image.round().astype(np.uint8))
        boxes.append(BoundingBox.from_center(center, (30, 20)).as_tuple())
    np.savetxt(place / 'groundtruth.txt', boxes, delimiter=',')
    return tmp_path


def test_deviations_of_edges_are_those_of_center_and_half_the_size():
    covariance = np.diag([4.0, 9.0, 16.0, 100.0])
    covariance[0, 2] = covariance[2, 0] = 2.0
    result = TrackResult(BOX, 1.0, TrackState.TRACKING, np.zeros((1, 1), np.float32), BOX,
                         velocity=(0, 0), covariance=covariance, predicted_box=BOX)
    # left = x - w / 2 and right = x + w / 2; the same for y and h.
    assert extent_sheet.edge_deviations(result) == pytest.approx(
        np.sqrt([4 + 4 - 2, 9 + 25, 4 + 4 + 2, 9 + 25]))


def test_sheet_is_drawn(dataset, tmp_path, monkeypatch, capsys):
    picture = tmp_path / 'sheet.png'
    monkeypatch.setattr('sys.argv', ['sheet', str(dataset), 'walk', '--output', str(picture)])
    extent_sheet.main()
    assert cv2.imread(str(picture)).std() > 10
    monkeypatch.setattr('sys.argv', ['sheet', str(dataset), 'run', '--output', str(picture)])
    with pytest.raises(SystemExit):
        extent_sheet.main()
    assert "holds no sequence called ['run']" in capsys.readouterr().err


def test_shares_of_edges_are_told(dataset, monkeypatch, capsys):
    monkeypatch.setattr('sys.argv', ['calibration', str(dataset), '--processes', '1'])
    edge_calibration.main()
    told = re.fullmatch(r'1 sequences, 7 frames, 28 edges: (\S+) within one deviation, '
                        r'(\S+) within two\n', capsys.readouterr().out)
    one, two = map(float, told.groups())
    assert 0.2 < one <= two <= 1


def test_errors_are_in_deviations(monkeypatch, dataset):
    monkeypatch.setattr(edge_calibration, 'edge_deviations', lambda result: np.full(4, 0.5))
    sequence, = edge_calibration.scan_dataset(dataset).sequences
    errors = edge_calibration.normalized_errors(sequence)
    assert errors.shape == (7, 4) and 0 < np.abs(errors).mean() < 8
