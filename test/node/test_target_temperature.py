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


"""Counts under the box, against a loop over all pixels."""

from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp
import numpy as np
import pytest
from rclpy.parameter import Parameter

from lmsco_ros.core.types import TrackState
from lmsco_ros.node.target_temperature import celsius, target_reading
from msg_adapters.status import Reading

SHAPES = hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=9)
IMAGES = st.one_of(
    hnp.arrays(np.uint8, SHAPES), hnp.arrays(np.uint16, SHAPES),
    hnp.arrays(np.float32, SHAPES, elements=st.floats(
        -1e6, 1e6, width=32) | st.sampled_from([np.nan, np.inf, -np.inf])))
NUMBERS = st.floats(-12, 12)
BOXES = st.tuples(NUMBERS, NUMBERS, st.floats(0.01, 20), st.floats(0.01, 20))


def reference(image, box):
    """Return the values of the pixels with their center in the box."""
    x, y, width, height = box
    return [float(image[row, column]) for row, column in np.ndindex(image.shape)
            if x <= column + 0.5 < x + width and y <= row + 0.5 < y + height
            and np.isfinite(image[row, column])]


@given(IMAGES, BOXES)
def test_reading_is_that_of_a_loop_over_all_pixels(image, box):
    values, reading = reference(image, box), target_reading(image, box)
    if not values:
        assert reading is None
    else:
        assert reading == pytest.approx(
            (min(values), sum(values) / len(values), max(values)), rel=1e-6, abs=1e-3)


def test_color_and_nothing_finite_have_no_reading():
    assert target_reading(np.zeros((9, 9, 3), np.uint8), (0, 0, 5, 5)) is None
    assert target_reading(np.full((9, 9), np.nan, np.float32), (0, 0, 5, 5)) is None


def test_numbers_that_no_camera_measures_do_not_count():
    image = np.full((9, 9), 300.0, np.float32)
    image[2, 2] = np.finfo(np.float32).max
    assert target_reading(image, (0, 0, 9, 9)) == Reading(300.0, 300.0, 300.0)


def test_centikelvin_and_unknown_scale():
    assert celsius(Reading(27315, 30000, 31015), 0.01, -273.15) == pytest.approx(
        (0.0, 26.85, 37.0))
    assert celsius(None, 0.01, -273.15) is None
    assert celsius(Reading(1, 2, 3), 0.0, -273.15) is None


def test_status_tells_the_temperature_of_a_target_in_sight(running):
    running.start(10, 12, 8, 6)
    message = running.graph.image(30000)
    pixels = np.frombuffer(message.data, np.uint16).reshape(48, 64)
    pixels[12, 10], pixels[17, 17], pixels[0, 0] = 29000, 31096, 65535
    status = running.send(message)
    assert status.target == (29000, pytest.approx(30000 + 96 / 48), 31096)
    assert status.target_celsius is None
    for name, value in (('radiometric_scale', 0.01), ('radiometric_offset', -273.15)):
        result, = running.node.set_parameters([Parameter(name, value=value)])
        assert result.successful
    assert running.send(running.graph.image(30000)).target_celsius == pytest.approx([26.85] * 3)
    running.fake.states = [TrackState.LOST]
    status = running.send()
    assert (status.target, status.target_celsius) == (None, None)
