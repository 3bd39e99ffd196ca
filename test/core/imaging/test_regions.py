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

"""Patches, search regions, and boxes that can be tracked."""

import math

from hypothesis import assume, given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.config import SamplingConfig
from lmsco_ros.core.errors import BoxError
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.regions import (
    at_border, check_box, clamp_box, held_at_border, patch_size, region_around, search_tiles,
    visible_part)
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox

WIDTH, HEIGHT = 64, 48
COUNTS = IntensityRange(0, 1)
DEEP = IntensityRange(0, 2**16)
# The bilinear interpolation rounds positions to 1/32 of a pixel.
POSITION = 1 / 32


def ramp(x, y):
    """Return the value of the test image at a point of the plane."""
    return 2 * x + 3 * y


def ramp_view():
    """Return an image whose pixel (0, 0) covers [0, 1): its value is that of (0.5, 0.5)."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    return FrameView(ramp(x, y).astype(np.float32), COUNTS)


def points(region, size):
    """Return the middles of the patch pixels, in image coordinates."""
    x = region.x + (np.arange(size[0]) + 0.5) * region.width / size[0]
    y = region.y + (np.arange(size[1]) + 0.5) * region.height / size[1]
    return np.meshgrid(x, y)


@given(x=st.floats(6, 20), y=st.floats(6, 15), width=st.floats(3, 36), height=st.floats(3, 26),
       columns=st.integers(3, 40), rows=st.integers(3, 40))
def test_positions_on_a_ramp(x, y, width, height, columns, rows):
    region = BoundingBox(x, y, width, height)
    patch = ramp_view().patch(region, (columns, rows))
    assert patch.shape == (rows, columns) and patch.dtype == np.float32
    scale = (max(1, int(width / columns)), max(1, int(height / rows)))
    np.testing.assert_allclose(patch, ramp(*points(region, (columns, rows))),
                               atol=POSITION * (2 * scale[0] + 3 * scale[1]))


def test_one_to_one_region_is_the_image_itself(rng):
    image = rng.integers(0, 2**16, (HEIGHT, WIDTH)).astype(np.uint16)
    patch = FrameView(image, DEEP).patch(BoundingBox(10, 5, 20, 30), (20, 30))
    np.testing.assert_array_equal(patch, image[5:35, 10:30] / np.float32(2**16))


@given(x=st.floats(-60, 80), y=st.floats(-60, 60), side=st.floats(4, 60))
def test_border_pixels_go_on_outside(x, y, side):
    region = BoundingBox(x, y, side, side)
    # In a range so wide that no corner of the ramp counts as a dead pixel.
    patch = 2**16 * FrameView(ramp_view().image, DEEP).patch(region, (61, 61))
    px, py = points(region, (61, 61))
    expected = ramp(np.clip(px, 0.5, WIDTH - 0.5), np.clip(py, 0.5, HEIGHT - 0.5))
    np.testing.assert_allclose(patch, expected, atol=5 * POSITION)


@pytest.mark.parametrize('corner, row, column', [
    ((-500, -500), 0, 0), ((900, -500), 0, -1), ((-500, 900), -1, 0), ((900, 900), -1, -1)])
@pytest.mark.parametrize('size', [8, 40])
def test_region_without_a_pixel_shows_the_nearest_corner(corner, row, column, size):
    view = ramp_view()
    patch = view.patch(BoundingBox(*corner, 40, 40), (size, size))
    np.testing.assert_allclose(patch, view.image[row, column], rtol=1e-6)


@pytest.mark.parametrize('factor', [2, 3, 5])
@pytest.mark.parametrize('offset', [20, 21, 23])
def test_shrinking_averages_all_pixels(rng, factor, offset):
    image = rng.random((90, 100), np.float32)
    side = 6 * factor
    patch = FrameView(image, COUNTS).patch(BoundingBox(offset, offset + 2, side, side), (6, 6))
    pixels = image[offset + 2:offset + 2 + side, offset:offset + side]
    expected = pixels.reshape(6, factor, 6, factor).mean(axis=(1, 3))
    np.testing.assert_allclose(patch, expected, atol=1e-5)


def test_checkerboard_does_not_alias():
    y, x = np.indices((96, 96))
    board = ((x + y) % 2).astype(np.float32)
    patch = FrameView(board, COUNTS).patch(BoundingBox(1.3, 2.7, 90, 88), (21, 21))
    np.testing.assert_allclose(patch, 0.5, atol=0.1)


@pytest.mark.parametrize('region', [BoundingBox(3, 4, 20, 20), BoundingBox(-20, 5.5, 60, 50)])
def test_all_types_give_the_same_patch(rng, region):
    counts = rng.integers(0, 200, (HEIGHT, WIDTH))
    intensity = IntensityRange(20, 180)
    patches = [FrameView(image, intensity).patch(region, (17, 17)) for image in (
        counts.astype(np.uint8), counts.astype(np.uint16), counts.astype(np.float32),
        np.repeat(counts.astype(np.uint8)[:, :, None], 3, axis=2))]
    for patch in patches[1:]:
        # Averages of integers are rounded to whole counts.
        np.testing.assert_allclose(patch, patches[0], atol=0.51 / 160)


def test_range_becomes_zero_to_one():
    image = np.full((HEIGHT, WIDTH), 7100, np.uint16)
    image[:, :32] = 7300
    view = FrameView(image, IntensityRange(7000, 7400))
    assert view.patch(BoundingBox(2, 2, 10, 10), (10, 10)).mean() == pytest.approx(0.75)
    assert view.patch(BoundingBox(40, 2, 10, 10), (10, 10)).mean() == pytest.approx(0.25)
    assert view.size == (WIDTH, HEIGHT)


def test_pixels_without_a_value_do_not_spread(rng):
    image = rng.uniform(size=(HEIGHT, WIDTH)).astype(np.float32)
    clean = FrameView(image, COUNTS).patch(BoundingBox(5, 5, 30, 30), (30, 30))
    broken = image.copy()
    broken[15, 15], broken[20, 20], broken[25, 25] = np.nan, np.inf, -np.inf
    patch = FrameView(broken, COUNTS).patch(BoundingBox(5, 5, 30, 30), (30, 30))
    assert np.isfinite(patch).all()
    changed = np.argwhere(patch != clean)
    np.testing.assert_array_equal(changed, [[10, 10], [15, 15], [20, 20]])
    shrunk = FrameView(broken, COUNTS).patch(BoundingBox(5, 5, 30, 30), (10, 10))
    assert np.isfinite(shrunk).all() and np.abs(shrunk).max() <= 1


def test_image_is_left_alone(rng):
    image = rng.uniform(size=(HEIGHT, WIDTH)).astype(np.float32)
    image[3, 3] = np.nan
    image.flags.writeable = False
    FrameView(image, COUNTS).patch(BoundingBox(0, 0, 30, 30), (10, 10))


@given(cx=st.floats(-10, 99), cy=st.floats(-10, 99), w=st.floats(2, 90), h=st.floats(2, 90),
       factor=st.floats(1.5, 10))
def test_region_is_a_square_around_the_target(cx, cy, w, h, factor):
    box = BoundingBox.from_center((cx, cy), (w, h))
    region = region_around(box, SamplingConfig(search_factor=factor))
    assert region.width == pytest.approx(region.height)
    assert region.area == pytest.approx(factor**2 * box.area)
    assert region.center == pytest.approx(box.center)


def is_fast(number):
    """Return whether an odd number has no prime factor above 13."""
    factors = [p for p in range(2, number + 1) if number % p == 0
               and all(p % q for q in range(2, p))]
    return number % 2 == 1 and all(p <= 13 for p in factors)


@given(w=st.floats(2, 300), h=st.floats(2, 300), low=st.integers(60, 250),
       extra=st.integers(0, 200), cell=st.integers(1, 8))
def test_patch_is_the_fast_odd_number_of_cells_nearest_to_the_region(w, h, low, extra, cell):
    config = SamplingConfig(search_factor=4.0, patch_size_min=low, patch_size_max=low + extra)
    side = patch_size((w, h), config, cell)
    wanted = min(max(4 * math.sqrt(w * h), low), low + extra)
    assert side % cell == 0 and is_fast(side // cell)
    assert side <= low + extra + cell
    best = min(abs(n * cell - wanted) for n in range(5, (low + extra) // cell + 1) if is_fast(n))
    assert abs(side - wanted) <= best + 1e-9


@given(width=st.integers(8, 900), height=st.integers(8, 900), side=st.floats(20, 2000),
       x=st.floats(0, 1), y=st.floats(0, 1))
def test_tiles_cover_the_image(width, height, side, x, y):
    assume(width * height / side**2 < 400)
    tiles = np.array(search_tiles((width, height), side, (width / 2, height / 2)))
    point = np.array([x * width, y * height])
    reach = np.abs(tiles - point).max(axis=1).min()
    # Some tile sees the point well inside of it, where a target is whole.
    assert reach <= side / 4 + 1e-6


def test_tiles_spread_from_the_last_position():
    around = (100.0, 30.0)
    tiles = search_tiles((320, 240), 80, around)
    distances = [math.dist(tile, around) for tile in tiles]
    assert distances == sorted(distances)
    assert len(set(tiles)) == len(tiles)


boxes = st.builds(BoundingBox, st.floats(-300, 300), st.floats(-300, 300),
                  st.floats(0.1, 400), st.floats(0.1, 400))


@given(box=boxes)
def test_boxes_are_refused_for_a_reason(box):
    visible = (max(0, min(box.x + box.width, 200) - max(box.x, 0))
               * max(0, min(box.y + box.height, 100) - max(box.y, 0))) / box.area
    small = min(box.width, box.height) < 2
    large = box.width > 200 or box.height > 100
    assume(abs(visible - 0.25) > 1e-6)
    if small or large or visible < 0.25:
        with pytest.raises(BoxError, match='pixels') as caught:
            check_box(box, (200, 100))
        assert ('smaller' in str(caught.value)) == small
        assert ('larger' in str(caught.value)) == (large and not small)
    else:
        check_box(box, (200, 100))


@given(box=boxes)
def test_clamped_boxes_can_be_tracked(box):
    clamped = clamp_box(box, (200, 100))
    assert 0 <= clamped.center[0] <= 200 and 0 <= clamped.center[1] <= 100
    assert max(clamped.size) <= 2 * math.hypot(200, 100) * 1.001
    assert clamped.width / clamped.height == pytest.approx(box.width / box.height, rel=1e-6)
    if max(box.size) / min(box.size) < 100:
        assert min(clamped.size) >= 2 * 0.999


@given(x=st.floats(0, 150), y=st.floats(0, 60), w=st.floats(2, 40), h=st.floats(2, 40))
def test_good_boxes_stay_as_they_are(x, y, w, h):
    box = BoundingBox(x, y, w, h)
    assert clamp_box(box, (200, 100)).as_tuple() == pytest.approx(box.as_tuple(), abs=1e-9)


@pytest.mark.parametrize('size', [(30, 30), (10, 10)])
def test_dead_pixels_leave_no_trace(rng, size):
    image = (100 + rng.normal(size=(90, 100))).astype(np.float32)
    broken = image.copy()
    broken[20, 25], broken[31, 40], broken[:, 33] = 5000, -5000, 9000
    region, counts = BoundingBox(15, 10, 30, 30), IntensityRange(50, 150)
    clean = FrameView(image, counts).patch(region, size)
    repaired = FrameView(broken, counts).patch(region, size)
    assert np.abs(repaired - clean).max() < 0.1


@pytest.mark.parametrize('box, cut', [
    ((10, 10, 20, 20), ((False, False), (False, False))),
    ((1.4, 10, 20, 20), ((True, False), (False, False))),
    ((1.6, 10, 20, 20), ((False, False), (False, False))),
    ((50, -5, 14, 20), ((False, True), (True, False))),
    ((10, 10, 20, 36.6), ((False, False), (False, True)))])
def test_edges_at_the_border_are_known(box, cut):
    assert at_border(BoundingBox(*box), (WIDTH, HEIGHT)) == cut


@pytest.mark.parametrize('last, moved, held', [
    ((20, 20, 10, 10), (26, 22, 10, 10), (26, 22, 10, 10)),
    ((0, 20, 10, 10), (4, 22, 10, 10), (0, 22, 14, 10)),
    ((1, 20, 10, 10), (-3, 22, 10, 10), (-3, 22, 10, 10)),
    ((54, 38, 10, 10), (50, 33, 10, 10), (50, 33, 14, 15))],
    ids=['in view', 'coming in', 'leaving', 'in the corner'])
def test_what_moves_away_from_the_border_shows_more_of_itself(last, moved, held):
    """In an image of 64 x 48 pixels."""
    assert held_at_border(BoundingBox(*moved), BoundingBox(*last),
                          (WIDTH, HEIGHT)) == BoundingBox(*held)


def test_box_over_the_border_is_shown_up_to_it():
    inside = BoundingBox(3.1, 4.2, 5.3, 6.4)
    assert visible_part(inside, (40, 30)) is inside
    assert visible_part(BoundingBox(-4, 25, 10, 10), (40, 30)) == BoundingBox(0, 25, 6, 5)
