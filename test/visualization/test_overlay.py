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

"""The overlay shows what the tracker said and leaves the picture alone otherwise."""

from dataclasses import replace

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.visualization import DisplayRange, draw_overlay, draw_targets, state_color


def result_of(state=TrackState.TRACKING, box=BoundingBox(60, 50, 40, 30), score=0.8):
    return TrackResult(box, score, state, np.zeros((8, 8), np.float32), box)


def scene(shape=(120, 160), dtype=np.uint16, low=8000, high=8600):
    values = np.linspace(low, high, shape[0] * shape[1])
    return values.reshape(shape).astype(dtype)


def state_seen_along(edge):
    """Return the state whose color the pixels of `edge` are closest to in hue."""
    tint = edge.astype(float).mean(0)
    tint -= tint.mean()

    def likeness(state):
        color = np.array(state_color(state), float)
        return tint @ (color - color.mean()) / np.linalg.norm(color - color.mean())

    return max(TrackState, key=likeness)


@pytest.mark.parametrize('image', [
    scene(), scene(dtype=np.float32), scene(dtype=np.uint8, low=0, high=255),
    np.zeros((1080, 1920), np.uint16), np.zeros((20, 12, 3), np.uint8)],
    ids=['mono16', 'float', 'mono8', 'large', 'tiny color'])
def test_keeps_size_and_does_not_touch_the_image(image):
    before = image.copy()
    canvas = draw_overlay(image, result_of(), label='frame 3')
    assert canvas.shape == image.shape[:2] + (3,)
    assert canvas.dtype == np.uint8
    np.testing.assert_array_equal(image, before)


def test_box_edges_lie_on_the_box():
    image = np.zeros((120, 160), np.uint8)
    canvas = draw_overlay(image, result_of(box=BoundingBox(60.5, 50.5, 40, 30)))
    frame = canvas.sum(-1, dtype=int)
    rows, columns = frame[45:90, 80], frame[65, 50:110]
    assert sorted(np.argsort(rows)[-2:] + 45) == [50, 80]
    assert sorted(np.argsort(columns)[-2:] + 50) == [60, 100]


@pytest.mark.parametrize('state', list(TrackState))
def test_state_decides_the_color(state):
    canvas = draw_overlay(scene(), result_of(state, BoundingBox(60.5, 50.5, 40, 30)))
    assert state_seen_along(canvas[50, 60:100]) is state


def test_first_target_is_drawn_alone_and_a_later_one_with_its_number():
    one = draw_targets(scene(), {1: result_of()}, 1, label='frame 3')
    plain = draw_overlay(scene(), result_of(), label='frame 3')
    np.testing.assert_array_equal(one, plain)
    np.testing.assert_array_equal(draw_targets(scene(), {}, 0), draw_overlay(scene(), None))
    # Those before it are gone; which one this is has to be told still.
    assert (draw_targets(scene(), {3: result_of()}, 3, label='frame 3') != plain).any()


def test_several_targets_are_told_apart_by_number_score_and_state():
    """State and score of the selected one are in the corner, number and score beside each box."""
    other = result_of(TrackState.UNCERTAIN, BoundingBox(105.5, 60.5, 20, 20), 0.35)
    results, image = {1: result_of(), 2: other}, np.zeros((120, 160), np.uint8)
    canvas = draw_targets(image, results, 1)
    alone = draw_overlay(image, result_of())
    changed = (canvas != alone).any(-1)
    assert state_seen_along(canvas[60, 107:123]) is TrackState.UNCERTAIN
    # Both are written below their boxes, and nothing else has changed.
    beside = np.s_[82:100, 60:103], np.s_[82:100, 105:150]
    assert all(changed[place].any() for place in beside)
    changed[58:83, 103:128] = False
    for place in beside:
        changed[place] = False
    assert not changed.any()
    for others in ({7: results[1], 2: other}, {1: results[1], 2: replace(other, score=0.85)}):
        swapped = draw_targets(image, others, max(others) if 7 in others else 1)
        assert (swapped[82:100] != canvas[82:100]).any()


@pytest.mark.parametrize('box', [(-30, -30, 40, 40), (140, 110, 60, 60), (150, -5, 30, 300)])
def test_number_of_a_box_that_leaves_the_image_is_seen(box):
    image, results = np.zeros((120, 160), np.uint8), {1: result_of(), 2: result_of(
        box=BoundingBox(*box))}
    two, hidden = (draw_targets(image, {**results, number: results[2]}, 1)
                   for number in (2, 3))
    assert (two != hidden).any()


def test_lost_box_is_dashed():
    def edge_pixels(state):
        image = np.zeros((120, 160), np.uint8)
        box = BoundingBox(60.5, 50.5, 40, 30)
        return draw_overlay(image, result_of(state, box))[50, 62:98].any(-1)

    assert edge_pixels(TrackState.TRACKING).all()
    assert 0.3 < edge_pixels(TrackState.LOST).mean() < 0.8


def test_status_leaves_a_target_in_the_corner_visible():
    image = np.full((120, 160), 200, np.uint8)
    canvas = draw_overlay(image, result_of(box=BoundingBox(4, 4, 12, 10)))
    assert (canvas[7:11, 7:13] == 200).all()


def test_score_bar_grows_with_the_score():
    def lit(score):
        canvas = draw_overlay(np.zeros((240, 320), np.uint8), result_of(score=score))
        bar = (canvas[:20, :120] == state_color(TrackState.TRACKING)).all(-1)
        return bar.sum(1).max()

    assert lit(0.1) < lit(0.5) < lit(0.95)


def test_without_a_result_only_the_label_is_drawn():
    image = np.full((120, 160), 99, np.uint8)
    assert (draw_overlay(image, None) == 99).all()
    labeled = draw_overlay(image, None, label='12')
    assert (labeled[:100] == 99).all() and (labeled[100:] != 99).any()


@settings(max_examples=50, deadline=None)
@given(st.floats(-1e7, 1e7), st.floats(-1e7, 1e7), st.floats(1e-3, 1e7), st.floats(1e-3, 1e7),
       st.sampled_from(list(TrackState)))
def test_any_box_can_be_drawn(x, y, width, height, state):
    image = np.zeros((30, 40), np.uint8)
    draw_overlay(image, result_of(state, BoundingBox(x, y, width, height)))


def test_unsupported_image_is_refused():
    with pytest.raises(ImageError, match=r'\(4, 4, 3\).*float32'):
        draw_overlay(np.zeros((4, 4, 3), np.float32), None)


class TestDisplayRange:
    def test_narrow_radiometric_range_fills_the_view(self):
        view = DisplayRange().apply(scene(low=8000, high=8600))
        assert view.min() < 40 and view.max() > 215

    def test_eight_bit_passes_through(self):
        image = scene(dtype=np.uint8, low=10, high=20)
        assert DisplayRange().apply(image) is image

    def test_a_hot_spot_that_appears_does_not_flicker(self):
        display, image = DisplayRange(), scene()
        calm = display.apply(image).astype(int)
        warm = image.copy()
        warm[40:80, 40:80] = 9400

        def change(view):
            return np.abs(view.astype(int) - calm)[:35].max()

        assert change(DisplayRange().apply(warm)) > 30
        assert change(display.apply(warm)) < 15

    def test_follows_a_lasting_change(self):
        display, image = DisplayRange(), scene()
        display.apply(image)
        shifted = image + 300
        for _ in range(60):
            view = display.apply(shifted)
        np.testing.assert_allclose(view, DisplayRange().apply(shifted), atol=2)

    def test_jumps_when_nothing_of_the_old_range_is_left(self):
        display, image = DisplayRange(), scene()
        display.apply(image)
        other = image + 20000
        np.testing.assert_array_equal(display.apply(other), DisplayRange().apply(other))

    @pytest.mark.parametrize('value', [0, 7, 65535])
    def test_flat_image(self, value):
        view = DisplayRange().apply(np.full((8, 9), value, np.uint16))
        assert view.shape == (8, 9) and np.ptp(view) == 0

    def test_invalid_pixels_do_not_disturb(self):
        image = scene(dtype=np.float32)
        clean = DisplayRange().apply(image)
        image[3, 4], image[5, 6] = np.nan, np.inf
        dirty = DisplayRange().apply(image)
        assert np.abs(dirty.astype(int) - clean)[10:].max() <= 1

    def test_all_invalid(self):
        assert (DisplayRange().apply(np.full((4, 4), np.nan, np.float32)) == 0).all()

    def test_rate_is_checked(self):
        with pytest.raises(ValueError, match='rate'):
            DisplayRange(rate=0)
