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

"""Where a target is expected that nobody sees: what is told of a camera that pans."""

import cv2
import numpy as np
import pytest

from benchmarks import camera_motion
from benchmarks.camera_motion import errors, table
from lmsco_ros.evaluation.datasets import TrackingSequence


class Pans(list):
    """Views of a ground, as the camera turns."""

    signature = 'pans'


def panning(way, gone=None):
    """Return 90 frames of a target at rest before ground; the camera turns from the 25th on."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.normal(0, 1, (240, 640)), (0, 0), 4)
    ground = (8000 + 100 * ground / ground.std()).astype(np.uint16)
    lefts = np.maximum(0, np.arange(90) - 25) * way
    truth = np.array([(200.0 - left, 100, 20, 20) for left in lefts])
    if gone is not None:
        truth[gone] = np.nan
    frames = Pans(np.ascontiguousarray(ground[:, left:left + 320]) for left in lefts)
    return TrackingSequence('pan', 'made', frames, truth)


@pytest.fixture(autouse=True)
def near(monkeypatch):
    """Look no further than these frames are long."""
    monkeypatch.setattr(camera_motion, 'HORIZONS', (5, 40))


def test_errors_are_those_of_the_pan_in_sides(monkeypatch):
    # Not seen from frame 20 on, it is expected where it was; of 40 frames the camera turns in 35.
    monkeypatch.setattr(camera_motion, '_EVERY', 100)
    sequence = panning(2)
    np.testing.assert_allclose(errors(sequence, camera=False), [0, 3.5], atol=0.01)
    np.testing.assert_allclose(errors(sequence, camera=True), 0, atol=0.5)


def test_table_tells_both_and_how_many_sequences():
    rows = table([panning(2), panning(0), panning(2, gone=slice(0, 90, 8))]).splitlines()[2:]
    frames, sequences, *figures = [cell.strip() for cell in rows[1].strip('|').split('|')]
    assert (frames, sequences) == ('40', '2')
    without, with_camera = float(figures[2]), float(figures[3])
    assert without > 1 and with_camera < 0.3


def test_table_of_nothing_says_what_to_do():
    with pytest.raises(SystemExit, match='no sequence shows its target for 60 frames'):
        table([panning(2, gone=slice(0, 90, 8))])
