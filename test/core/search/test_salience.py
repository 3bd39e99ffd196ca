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
