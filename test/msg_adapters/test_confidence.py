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

"""Confidence maps lie where the image says they lie."""

from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest
from std_msgs.msg import Header

from msg_adapters.confidence import aligned_confidence, message_from_confidence
from msg_adapters.errors import BoxMessageError
from msg_adapters.image import image_from_message

SCORES = hnp.arrays(np.float32, st.tuples(st.integers(1, 6), st.integers(1, 6)),
                    elements=st.floats(0, 1, width=32))
REGIONS = st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(0.3, 60),
                    st.floats(0.3, 60))
SHAPE = (17, 23)


def _one_pixel(scores, region, row, column):
    """Interpolate for one pixel center by hand."""
    x, y, width, height = region
    inside = x <= column + 0.5 < x + width and y <= row + 0.5 < y + height
    value = 0.0
    v = np.clip((row + 0.5 - y) / height * scores.shape[0] - 0.5, 0, scores.shape[0] - 1)
    u = np.clip((column + 0.5 - x) / width * scores.shape[1] - 0.5, 0, scores.shape[1] - 1)
    for i in range(scores.shape[0]):
        for j in range(scores.shape[1]):
            value += scores[i, j] * max(0, 1 - abs(v - i)) * max(0, 1 - abs(u - j))
    return value if inside else 0.0


@given(SCORES, REGIONS, st.integers(0, SHAPE[0] - 1), st.integers(0, SHAPE[1] - 1))
def test_every_pixel_is_interpolated(scores, region, row, column):
    aligned = aligned_confidence(scores, region, SHAPE)
    assert aligned.shape == SHAPE and aligned.dtype == np.float32
    assert aligned[row, column] == pytest.approx(
        _one_pixel(scores, region, row, column), abs=1e-4)


@given(hnp.arrays(np.float32, (4, 5), elements=st.floats(0, 1, width=32)),
       st.integers(-3, 20), st.integers(-3, 20))
def test_one_cell_per_pixel_is_copied(scores, x, y):
    canvas = np.zeros((40, 40), np.float32)
    canvas[y + 3:y + 7, x + 3:x + 8] = scores
    np.testing.assert_allclose(aligned_confidence(scores, (x, y, 5, 4), (37, 37)),
                               canvas[3:, 3:], atol=1e-6)


@given(SCORES, REGIONS)
def test_values_stay_in_range(scores, region):
    aligned = aligned_confidence(scores, region, SHAPE)
    assert aligned.min() >= 0 and aligned.max() <= scores.max() * (1 + 1e-5)


def test_region_off_the_image_is_all_zero():
    assert not aligned_confidence(np.ones((3, 3), np.float32), (-50, 5, 20, 20), SHAPE).any()


def test_message_has_the_size_and_header_of_the_source():
    header = Header(frame_id='thermal')
    message = message_from_confidence(np.ones((3, 3), np.float32), (2, 3, 4, 5), SHAPE, header)
    assert (message.encoding, message.header) == ('32FC1', header)
    expected = np.zeros(SHAPE, np.float32)
    expected[3:8, 2:6] = 1
    np.testing.assert_array_equal(image_from_message(message), expected)


@pytest.mark.parametrize('region', [(0, 0, 0, 5), (0, float('nan'), 5, 5)])
def test_regions_without_area_are_refused(region):
    with pytest.raises(BoxMessageError):
        aligned_confidence(np.ones((3, 3), np.float32), region, SHAPE)
