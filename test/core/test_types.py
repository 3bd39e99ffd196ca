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

"""Boxes and results."""

from dataclasses import FrozenInstanceError
import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core import (
    BoundingBox, BoxError, ConfigError, ImageError, LMSCOError, NotInitializedError, TimeError,
    TrackResult, TrackState)

coordinate = st.floats(-1e4, 1e4)
length = st.floats(1e-2, 1e4)
boxes = st.builds(BoundingBox, coordinate, coordinate, length, length)


@given(box=boxes)
def test_center_and_size_make_the_box(box):
    again = BoundingBox.from_center(box.center, box.size)
    assert again.as_tuple() == pytest.approx(box.as_tuple(), abs=1e-8)
    assert box.center == pytest.approx((box.x + box.width / 2, box.y + box.height / 2))
    assert box.area == box.width * box.height
    assert box.as_tuple() == (box.x, box.y, box.width, box.height)


@given(box=boxes, factor=st.floats(0.01, 100))
def test_scaling_keeps_center_and_shape(box, factor):
    scaled = box.scaled(factor)
    assert scaled.center == pytest.approx(box.center, abs=1e-6)
    assert scaled.size == pytest.approx((factor * box.width, factor * box.height))


@given(one=boxes, other=boxes)
def test_overlap_is_symmetric_and_bounded(one, other):
    assert one.overlap(other) == pytest.approx(other.overlap(one))
    assert 0 <= one.overlap(other) <= 1 + 1e-8  # rounding of the far sides
    assert one.intersection(other) <= min(one.area, other.area) * (1 + 1e-9)
    assert one.overlap(one) == pytest.approx(1, rel=1e-6)


@given(st.tuples(*[st.integers(0, 12)] * 2, *[st.integers(1, 8)] * 2),
       st.tuples(*[st.integers(0, 12)] * 2, *[st.integers(1, 8)] * 2))
def test_overlap_counts_pixels(one, other):
    masks = np.zeros((2, 20, 20), bool)
    for mask, (x, y, w, h) in zip(masks, (one, other), strict=True):
        mask[y:y + h, x:x + w] = True
    common, union = masks.all(axis=0).sum(), masks.any(axis=0).sum()
    assert BoundingBox(*one).intersection(BoundingBox(*other)) == common
    assert BoundingBox(*one).overlap(BoundingBox(*other)) == pytest.approx(common / union)


@given(box=boxes, gap=st.floats(0, 100))
def test_neighbors_do_not_overlap(box, gap):
    beside = BoundingBox(box.x + box.width + gap, box.y, box.width, box.height)
    assert box.overlap(beside) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize('numbers, reason', [
    ((0, 0, 0, 5), 'empty; width and height must be positive'),
    ((0, 0, 5, -1), 'empty; width and height must be positive'),
    ((math.nan, 0, 5, 5), 'not finite; give four finite numbers'),
    ((0, math.inf, 5, 5), 'not finite; give four finite numbers'),
    ((0, 0, math.inf, 5), 'not finite; give four finite numbers'),
])
def test_boxes_without_an_area_are_refused(numbers, reason):
    with pytest.raises(BoxError, match=reason):
        BoundingBox(*numbers)


def test_values_do_not_change():
    box = BoundingBox(1, 2, 3, 4)
    with pytest.raises(FrozenInstanceError):
        box.x = 5
    result = TrackResult(box, 0.5, TrackState.TRACKING, np.zeros((3, 3), np.float32), box)
    with pytest.raises(FrozenInstanceError):
        result.score = 1.0
    assert box == BoundingBox(1, 2, 3, 4) and hash(box) == hash(BoundingBox(1, 2, 3, 4))


def test_errors_share_a_base_that_is_a_value_error():
    for error in (BoxError, ConfigError, ImageError, NotInitializedError, TimeError):
        assert issubclass(error, LMSCOError) and issubclass(error, ValueError)


def test_states_have_names_for_the_outside():
    assert {state.value for state in TrackState} == {'tracking', 'uncertain', 'lost'}
