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

"""The summary shows the run: its frames, its states, and what it was worth."""

from itertools import accumulate

import cv2
import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.visualization.contact_sheet import ContactSheet, Moment


def moment(index, state=TrackState.TRACKING, score=0.8, truth=None, shape=(48, 64)):
    view = np.full(shape, 90, np.uint8)
    box = BoundingBox(20, 10, 12, 16)
    scores = np.outer(np.hanning(16), np.hanning(16)).astype(np.float32)
    result = TrackResult(box, score, state, scores, BoundingBox(2, -6, 48, 48))
    return Moment(index, view, result, truth)


def saved(path, moments, title='a run'):
    sheet = ContactSheet()
    for item in moments:
        sheet.add(item)
    sheet.save(path / 'summary.png', title)
    return cv2.imread(str(path / 'summary.png'))


def count_near(picture, blue_green_red, tolerance=12):
    distance = np.abs(picture.astype(int) - blue_green_red).max(-1)
    return int((distance <= tolerance).sum())


def test_a_picture_comes_out_whatever_the_shape_of_the_frames(tmp_path):
    for shape in ((64, 48), (48, 64, 3)):
        picture = saved(tmp_path, [moment(i, shape=shape) for i in range(2)])
        assert picture.shape[1] == 1600 and 700 < picture.shape[0] < 2000


def test_one_frame_is_enough(tmp_path):
    assert saved(tmp_path, [moment(0)]) is not None


def test_nothing_to_draw_is_an_error(tmp_path):
    with pytest.raises(ValueError, match='nothing'):
        ContactSheet().save(tmp_path / 'summary.png', 'empty')


def test_states_color_the_curve(tmp_path):
    calm = saved(tmp_path, [moment(i) for i in range(30)])
    lost = saved(tmp_path, [moment(i, TrackState.LOST if i > 14 else TrackState.TRACKING)
                            for i in range(30)])
    band = (225, 225, 255)
    assert count_near(lost, band) > count_near(calm, band) + 20000


def test_truth_adds_the_overlap(tmp_path):
    truth = BoundingBox(21, 12, 12, 16)
    without = saved(tmp_path, [moment(i) for i in range(12)])
    with_truth = saved(tmp_path, [moment(i, truth=truth) for i in range(12)])
    blue = (222, 111, 47)
    assert count_near(without, blue) == 0 and count_near(with_truth, blue) > 30


@pytest.mark.parametrize('length', [1, 2, 7, 60, 1000])
def test_shown_frames_span_runs_of_any_length_in_bounded_memory(tmp_path, monkeypatch, length):
    shown, kept = [], []
    monkeypatch.setattr('lmsco_ros.visualization.contact_sheet._draw_frame',
                        lambda axes, item: shown.append(item.index))
    sheet = ContactSheet()
    for index in range(length):
        sheet.add(moment(index))
        kept.append(len(sheet._moments))
    sheet.save(tmp_path / 'summary.png', 'long')
    assert list(accumulate(shown, max)) == shown
    assert len(shown) == min(length, 6)
    assert shown[0] == 0 and shown[-1] >= 0.9 * (length - 1)
    assert max(kept) <= 50
