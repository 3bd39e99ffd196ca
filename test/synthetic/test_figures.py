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

"""Bodies are drawn where their bounds say, at any place and size."""

import math

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from lmsco_ros.synthetic.figures import bounds, Capsule, rasterize, walker

SHAPE = (90, 120)
place = st.floats(20, 70)


def extent(layer):
    rows, columns = np.nonzero(layer.alpha > 0.02)
    return (columns.min() + layer.columns.start, rows.min() + layer.rows.start,
            columns.max() + 1 + layer.columns.start, rows.max() + 1 + layer.rows.start)


@settings(max_examples=50, deadline=None)
@given(place, st.floats(60, 85), st.floats(15, 50), st.floats(0, 7))
def test_bounds_enclose_the_drawn_pixels_tightly(x, ground, height, phase):
    body = walker((x, ground), height, phase, 8000)
    box = bounds(body)
    left, top, right, bottom = extent(rasterize(body, SHAPE))
    assert left == pytest.approx(box.x, abs=1.5)
    assert top == pytest.approx(box.y, abs=1.5)
    assert right == pytest.approx(box.x + box.width, abs=1.5)
    assert bottom == pytest.approx(box.y + box.height, abs=1.5)


@settings(max_examples=30, deadline=None)
@given(st.floats(20, 60), st.floats(20, 60), st.floats(3, 12))
def test_covered_area_is_exact_at_any_fraction_of_a_pixel(x, y, radius):
    layer = rasterize([Capsule(x, y, x + 9, y, radius, 1)], SHAPE)
    area = math.pi * radius ** 2 + 9 * 2 * radius
    assert layer.alpha.sum() == pytest.approx(area, rel=0.01)


@settings(max_examples=50, deadline=None)
@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(0.1, 300))
def test_bodies_out_of_sight_do_no_harm(x, y, radius):
    layer = rasterize([Capsule(x, y, x + 3, y - 4, radius, 1)], SHAPE)
    scene = np.zeros(SHAPE)
    assert scene[layer.rows, layer.columns].shape == layer.alpha.shape
    assert layer.alpha.min(initial=0) >= 0 and layer.alpha.max(initial=0) <= 1


def test_later_capsules_are_in_front():
    behind = Capsule(30, 30, 30, 30, 10, 100)
    front = Capsule(30, 30, 30, 30, 4, 900)
    layer = rasterize([behind, front], SHAPE)
    heat = layer.heat[layer.alpha == 1]
    assert heat.min() == 100 and heat.max() == 900
