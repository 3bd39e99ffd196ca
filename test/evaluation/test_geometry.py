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

"""Overlap and center offsets against hand-computed values."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.evaluation.geometry import center_offsets, clip_boxes, has_jumped, overlaps

ABSENT = [np.nan] * 4


def test_overlap_of_half_shifted_boxes_is_a_third():
    truth, answer = np.array([[0., 0, 10, 10]]), np.array([[5., 0, 10, 10]])
    assert overlaps(truth, answer) == pytest.approx(50 / 150)


def test_overlap_says_nan_for_an_absent_target_and_zero_for_no_answer():
    truth = np.array([ABSENT, [0, 0, 4, 4], ABSENT])
    answers = np.array([[0., 0, 4, 4], ABSENT, ABSENT])
    assert np.isnan(overlaps(truth, answers)).tolist() == [True, False, True]
    assert overlaps(truth, answers)[1] == 0


def test_only_what_lies_in_the_image_counts_when_its_size_is_given():
    truth, answer = np.array([[-5., 0, 10, 10]]), np.array([[0., 0, 5, 10]])
    assert overlaps(truth, answer) == pytest.approx(0.5)
    assert overlaps(truth, answer, size=(20, 20)) == pytest.approx(1)


def test_boxes_outside_the_image_keep_no_area():
    assert clip_boxes(np.array([[30., 5, 4, 4]]), (20, 20)).tolist() == [[20, 5, 0, 4]]
    assert overlaps(np.array([[30., 5, 4, 4]]), np.array([[30., 5, 4, 4]]), (20, 20)) == 0


def test_center_offsets_point_from_truth_to_answer():
    truth = np.array([[0., 0, 10, 10], [0, 0, 10, 10], ABSENT])
    answers = np.array([[3., 4, 10, 10], ABSENT, [0, 0, 1, 1]])
    offsets = center_offsets(truth, answers)
    assert offsets[0].tolist() == [3, 4]
    assert np.isinf(offsets[1]).all() and np.isnan(offsets[2]).all()


def test_target_jumps_by_more_than_two_of_its_sizes():
    truth = np.array([[0., 0, 4, 9], [11.9, 0, 4, 9], [24.0, 0, 4, 9], ABSENT, [90, 0, 4, 9]])
    assert has_jumped(truth).tolist() == [False, False, True, False, False]


side = st.floats(0.5, 50)
place = st.floats(-50, 50)
boxes = st.tuples(place, place, side, side)


@given(boxes, boxes)
def test_overlap_agrees_with_the_box_of_the_core(first, second):
    ours = overlaps(np.array([first]), np.array([second]))[0]
    assert ours == pytest.approx(BoundingBox(*first).overlap(BoundingBox(*second)), abs=1e-9)
    assert 0 <= ours <= 1
