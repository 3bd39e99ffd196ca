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

"""Salience: where something stands out as the target does."""

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.search.salience import Salience
from lmsco_ros.core.types import BoundingBox

SHAPE = (160, 200)


def view_of(*spots, noise=0.0, texture=0.0):
    """Return a frame with spots (x, y, side, contrast) on even ground, textured below row 100."""
    rng = np.random.default_rng(3)
    image = 0.4 + noise * rng.standard_normal(SHAPE)
    image[100:] += texture * rng.standard_normal((60, SHAPE[1]))
    for x, y, side, contrast in spots:
        image[y - side // 2:y + side // 2, x - side // 2:x + side // 2] += contrast
    return FrameView(image.astype(np.float32), IntensityRange(0.0, 1.0))


def box_at(x, y, side):
    return BoundingBox.from_center((x, y), (side, side))


@given(x=st.integers(20, 180), y=st.integers(20, 80), contrast=st.floats(0.1, 0.5),
       warm=st.booleans())
@settings(max_examples=20)
def test_target_on_even_ground_comes_first_wherever_it_is(x, y, contrast, warm):
    contrast = contrast if warm else -contrast
    salience = Salience(view_of((50, 50, 12, contrast), noise=0.01), box_at(50, 50, 12))
    view = view_of((x, y, 12, contrast), noise=0.01, texture=0.2)
    first = salience.candidates(view, box_at(50, 50, 12), 8)[0]
    assert first.center == pytest.approx((x, y), abs=2.5)
    assert first.size == pytest.approx((12, 12))


def test_what_is_colder_is_no_candidate_for_a_warm_target():
    salience = Salience(view_of((50, 50, 12, 0.3)), box_at(50, 50, 12))
    view = view_of((120, 40, 12, -0.5), (60, 80, 12, 0.1))
    first = salience.candidates(view, box_at(50, 50, 12), 8)[0]
    assert first.center == pytest.approx((60, 80), abs=1.5)


def test_size_is_told_by_the_scale_that_fits_best():
    salience = Salience(view_of((50, 50, 12, 0.3)), box_at(50, 50, 12))
    view = view_of((120, 40, 24, 0.3), noise=0.01)
    first = salience.candidates(view, box_at(50, 50, 12), 8, (0.5, 1.0, 2.0))[0]
    assert first.center == pytest.approx((120, 40), abs=3)
    assert first.width == pytest.approx(24)


def test_even_picture_has_no_candidate():
    salience = Salience(view_of((50, 50, 12, 0.3)), box_at(50, 50, 12))
    assert salience.candidates(view_of(), box_at(50, 50, 12), 8) == []


@pytest.mark.parametrize('count', [1, 3])
def test_no_more_candidates_than_asked_for(count):
    salience = Salience(view_of((50, 50, 12, 0.3)), box_at(50, 50, 12))
    spots = [(30 * n, 40, 12, 0.1 * n) for n in range(1, 6)]
    found = salience.candidates(view_of(*spots, noise=0.01), box_at(50, 50, 12), count)
    assert len(found) == count


def test_large_image_is_reduced_before_it_is_searched(monkeypatch):
    sizes = []
    patch = FrameView.patch
    monkeypatch.setattr(FrameView, 'patch', lambda view, region, size: sizes.append(size) or patch(
        view, region, size))
    image = np.full((1080, 1920), 0.4, np.float32)
    image[500:512, 900:912] = 0.8
    view = FrameView(image, IntensityRange(0.0, 1.0))
    found = Salience(view, box_at(906, 506, 12)).candidates(view, box_at(906, 506, 12), 1)
    assert np.prod(sizes[-1]) <= 101_000
    assert found[0].center == pytest.approx((906, 506), abs=5)


def test_large_target_is_found_in_a_reduced_picture():
    salience = Salience(view_of((60, 60, 60, 0.3), noise=0.01), box_at(60, 60, 60))
    first = salience.candidates(
        view_of((140, 80, 60, 0.3), noise=0.01), box_at(60, 60, 60), 4)[0]
    assert first.center == pytest.approx((140, 80), abs=8)


def signal_to_clutter(pixels, window):
    """Return the ratio around each pixel, from its definition; the picture is mirrored."""
    width, height = window
    reach = height, width
    wide = np.pad(pixels.astype(float), [(n, n) for n in reach], mode='reflect')
    ratio = np.zeros(pixels.shape)
    for row, column in np.ndindex(pixels.shape):
        around = wide[row:row + 2 * height + 1, column:column + 2 * width + 1]
        inner = np.zeros(around.shape, bool)
        inner[height - height // 2:, width - width // 2:][:height, :width] = True
        inside, ring = around[inner], around[~inner]
        ratio[row, column] = (inside.mean() - ring.mean()) / (ring.std() + 0.01)
    return ratio


def maxima(ratio, window):
    """Return ratio, row and column of all maxima in a window around them, the highest first."""
    found = []
    for row, column in np.argwhere(ratio > 0):
        around = ratio[max(0, row - window[1] // 2):row + window[1] // 2 + 1,
                       max(0, column - window[0] // 2):column + window[0] // 2 + 1]
        if ratio[row, column] == around.max():
            found.append((ratio[row, column], row, column))
    return sorted(found, reverse=True)


@pytest.mark.parametrize('contrast', [0.3, -0.3], ids=['warm', 'cold'])
@pytest.mark.parametrize('size', [(6, 4), (2, 9), (1, 9), (5, 5)])
def test_all_candidates_are_the_maxima_of_signal_to_clutter(rng, size, contrast):
    pixels = 0.4 + 0.03 * rng.standard_normal((44, 56)).astype(np.float32)
    pixels[:, 30:] += 0.1 * rng.standard_normal((44, 26)).astype(np.float32)
    pixels[20:20 + size[1], 20:20 + size[0]] += contrast
    view, box = FrameView(pixels, IntensityRange(0.0, 1.0)), BoundingBox(20, 20, *size)
    found = Salience(view, box).candidates(view, box, 1000)
    expected = maxima(np.sign(contrast) * signal_to_clutter(pixels, size), size)
    np.testing.assert_allclose([candidate.center for candidate in found],
                               [(column + 0.5, row + 0.5) for _, row, column in expected])
    assert {candidate.size for candidate in found} == {size}


def test_candidates_of_all_scales_are_in_one_order(rng):
    pixels = 0.4 + 0.03 * rng.standard_normal((44, 56)).astype(np.float32)
    pixels[10:16, 10:16] += 0.2
    view, box = FrameView(pixels, IntensityRange(0.0, 1.0)), BoundingBox(10, 10, 6, 6)
    found = Salience(view, box).candidates(view, box, 30, (1.0, 0.5))
    expected = sorted([(ratio, column + 0.5, row + 0.5, side) for side in (6, 3)
                       for ratio, row, column in maxima(
                           signal_to_clutter(pixels, (side, side)), (side, side))[:30]],
                      reverse=True)[:30]
    np.testing.assert_allclose([(*candidate.center, candidate.width) for candidate in found],
                               [values[1:] for values in expected])


@pytest.fixture
def sizes(monkeypatch):
    """Return the sizes to which pictures are reduced from now on."""
    sizes, patch = [], FrameView.patch
    monkeypatch.setattr(FrameView, 'patch', lambda view, region, size: sizes.append(
        (region.as_tuple(), size)) or patch(view, region, size))
    return sizes


@pytest.mark.parametrize('image, target, size', [
    ((200, 160), (5, 5), (200, 160)), ((200, 160), (40, 10), (100, 80)),
    ((1920, 1080), (10, 10), (422, 237)), ((4000, 5), (4000, 4), (316, 1)),
    ((5, 4000), (4, 4000), (1, 316))])
def test_picture_is_reduced_to_the_target_and_to_the_pixels(sizes, image, target, size):
    view = FrameView(np.zeros(image[::-1], np.uint8), IntensityRange(0, 1))
    box = BoundingBox(0, 0, *target)
    salience = Salience(view, box)
    sizes.clear()
    salience.candidates(view, box, 1)
    assert sizes == [((0, 0, *image), size)]


def test_place_is_right_where_rows_and_columns_are_reduced_differently():
    """Five rows become two: one of them stands for 2.5 pixels, and a column for 2."""
    image = np.full((5, 4000), 0.4, np.float32)
    image[:, 2950:3050] = 0.8
    view, box = FrameView(image, IntensityRange(0.0, 1.0)), BoundingBox(2950, 0, 100, 4)
    first, = Salience(view, box).candidates(view, box, 1)
    assert first.center == pytest.approx((3000, 2.5), abs=2)


def test_thin_target_is_a_pixel_wide_in_the_reduced_picture():
    image = np.full((160, 200), 0.4, np.float32)
    image[20:120, 60:64] = 0.8
    view = FrameView(image, IntensityRange(0.0, 1.0))
    box = BoundingBox(60, 20, 4, 100)
    first, = Salience(view, box).candidates(view, box, 1)
    # One of five in which it is reduced to 10 pixels of a square: 2 x 50.
    assert first.center == pytest.approx((62, 70), abs=2) and first.size == (4, 100)


def polarity(rows):
    """
    Return 1 where a target is taken for warm, -1 where for cold.

    Parameters
    ----------
    rows : ndarray, shape (32, 32)
        The target, 16 x 16 pixels, and its surroundings.

    """
    image = np.full((96, 96), 0.5, np.float32)
    image[32:64, 32:64] = rows
    box, view = BoundingBox(40, 40, 16, 16), FrameView(image, IntensityRange(0.0, 1.0))
    salience = Salience(view, box)
    warm, cold = np.full((2, 96, 96), 0.5, np.float32)
    warm[20:36, 20:36] += 0.25
    cold[20:36, 20:36] -= 0.25
    found = [salience.candidates(FrameView(shown, IntensityRange(0.0, 1.0)), box, 1)[0]
             for shown in (warm, cold)]
    right = [candidate.overlap(BoundingBox(20, 20, 16, 16)) > 0.5 for candidate in found]
    assert right[0] != right[1]
    return 1 if right[0] else -1


@pytest.fixture
def surroundings():
    """Return a target like its surroundings."""
    return np.full((32, 32), 0.5, np.float32)


def test_target_is_warm_where_its_warmest_part_differs_as_much(surroundings):
    surroundings[8:16, 8:24], surroundings[16:24, 8:24] = 0.75, 0.25
    assert polarity(surroundings) == 1
    surroundings[8:16, 8:24] = 0.625
    assert polarity(surroundings) == -1


@pytest.mark.parametrize('row, column', [(7, 16), (24, 16), (16, 7), (16, 24)])
def test_what_is_beside_the_target_does_not_count(surroundings, row, column):
    surroundings[8:24, 8:24] = 0.6
    surroundings[max(0, row - 3):row + 1 if row < 16 else row + 4, column - 4:column + 4] = 0.0
    surroundings[8:24, 8:24] = 0.6
    surroundings[row, column - 4:column + 4] = 0.0
    assert polarity(surroundings) == 1


def test_few_pixels_do_not_count(surroundings):
    surroundings[8:24, 8:24] = 0.4
    surroundings[12, 10:14] = 1.0
    assert polarity(surroundings) == -1
    # Seven of 256 are more than two in a hundred, and less than three.
    surroundings[8:24, 8:24] = 0.6
    surroundings[12, 10:17] = 0.0
    assert polarity(surroundings) == -1


def test_surroundings_are_what_is_around_the_target(surroundings):
    """A little more of them is cold, and the target is nearly as warm as the rest."""
    surroundings[:, :] = 1.0
    ring = np.ones((32, 32), bool)
    ring[8:24, 8:24] = False
    rows, columns = np.nonzero(ring)
    surroundings[rows[:430], columns[:430]] = 0.0
    surroundings[8:24, 8:24] = 0.9
    surroundings[9, 8:24] = surroundings[11, 8:24] = 0.0
    assert polarity(surroundings) == 1
