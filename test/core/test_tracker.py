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

"""The tracker as its users see it: what it takes, what it gives, what it refuses."""

from dataclasses import replace
import gc
import weakref

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from lmsco_ros.core import (
    BoundingBox, BoxError, ConfigError, ImageError, LMSCOError, LMSCOTracker, MultiTracker,
    NotInitializedError, PointError, TimeError, TrackerConfig, TrackResult, TrackState)
from lmsco_ros.core.config import (
    ChannelConfig, ExtentConfig, FeatureConfig, LearningConfig, SamplingConfig, ScaleConfig,
    SearchConfig)
from lmsco_ros.core.imaging.regions import visible_part

# Small, since most of what is asked here does not depend on accuracy.
FAST = TrackerConfig(
    features=(FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity')), 4),),
    sampling=SamplingConfig(search_factor=4.0, patch_size_min=84, patch_size_max=84),
    learning=LearningConfig(initial_iterations=10, iterations=2, gradient_steps=2,
                            memory_size=5, update_interval=2))
CENTER, SIZE = (80.3, 60.4), (24.0, 18.0)


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene()


@pytest.fixture
def tracker():
    return LMSCOTracker(FAST)


def box_of(center=CENTER, size=SIZE):
    """Return the box around a center."""
    return BoundingBox.from_center(center, size)


def later(scene, n=1):
    """Return the first frame n frames later: the target stands, the ground has moved a little."""
    return scene.frame(CENTER, pan=(0.1 * n, 0))


def walk(scene, count, config=FAST, convert=lambda image: image):
    """Return the results of a target that moves to the right."""
    runner = LMSCOTracker(config)
    results = []
    for n in range(count):
        image = convert(scene.frame((CENTER[0] + n, CENTER[1])))
        image.flags.writeable = False
        results.append(runner.initialize(image, box_of()) if n == 0 else runner.update(image))
    return results


def test_motion_is_told_per_frame_or_per_second(scene):
    plain, timed = LMSCOTracker(FAST), LMSCOTracker(FAST)
    for n in range(12):
        image = scene.frame((CENTER[0] + n, CENTER[1]))
        results = [runner.update(image, *time) if n else runner.initialize(image, box_of(), *time)
                   for runner, time in ((plain, ()), (timed, (50 + 0.1 * n,)))]
    one, other = results
    assert one.box == other.box and one.score == other.score
    assert one.velocity == pytest.approx((1.0, 0.0), abs=0.1)
    assert other.velocity == pytest.approx((10.0, 0.0), abs=1.0)
    assert one.predicted_box.overlap(one.box) > 0.95 and one.covariance.shape == (4, 4)


def test_lost_target_goes_on_as_a_prediction_that_knows_less_and_less(make_scene, tracker):
    scene = make_scene(clutter=150.0)
    for n in range(12):
        image = scene.frame((CENTER[0] + n, CENTER[1]))
        tracker.update(image) if n else tracker.initialize(image, box_of())
    gone = [tracker.update(scene.frame(pan=(0.1 * n, 0))) for n in range(10)]
    assert gone[-1].state is TrackState.LOST and gone[-1].box == gone[0].box
    assert gone[-1].predicted_box.center[0] > gone[-1].box.center[0] + 5
    steps = [np.linalg.eigvalsh(b.covariance - a.covariance) for a, b in zip(gone, gone[1:])]
    assert np.min(steps) > 0


def test_time_that_does_not_fit_is_refused_and_the_target_kept(scene, tracker):
    with pytest.raises(TimeError, match="the time of the frame is 'now'"):
        tracker.initialize(scene.frame(CENTER), box_of(), 'now')
    assert not tracker.initialized
    tracker.initialize(scene.frame(CENTER), box_of(), 1.0)
    with pytest.raises(TimeError, match='give the time of every frame'):
        tracker.update(later(scene))
    assert tracker.update(later(scene), 2.0).box.overlap(box_of()) > 0.9


def test_first_result_is_the_given_box(scene, tracker):
    assert not tracker.initialized
    result = tracker.initialize(scene.frame(CENTER), box_of())
    assert tracker.initialized
    assert (result.box, result.state, result.note) == (box_of(), TrackState.TRACKING, '')
    assert result.score > 0.9


def test_results_have_the_promised_types(scene):
    for result in walk(scene, 4):
        assert isinstance(result, TrackResult) and isinstance(result.box, BoundingBox)
        assert all(type(v) is float for v in (*result.box.as_tuple(), result.score))
        assert 0 <= result.score <= 1 and isinstance(result.state, TrackState)
        scores = result.confidence_map
        assert scores.dtype == np.float32 and scores.ndim == 2
        assert scores.shape[0] == scores.shape[1] and np.isfinite(scores).all()
        assert result.search_region.width == pytest.approx(result.search_region.height)


@pytest.mark.parametrize('reach', [0, 1])
def test_map_lies_over_the_search_region(scene, reach):
    config = TrackerConfig(
        features=FAST.features, sampling=FAST.sampling, learning=FAST.learning,
        scale=ScaleConfig(exponent_min=-reach, exponent_max=reach))
    previous = box_of()
    for n, result in enumerate(walk(scene, 6, config)):
        region, scores = result.search_region, result.confidence_map
        cell = region.width / len(scores)
        row, column = np.unravel_index(np.argmax(scores), scores.shape)
        seen = (region.x + (column + 0.5) * cell, region.y + (row + 0.5) * cell)
        assert seen == pytest.approx(result.box.center, abs=cell)
        # The target was searched for where it had been.
        assert region.center == pytest.approx(previous.center, abs=1e-6)
        assert seen[0] == pytest.approx(CENTER[0] + n, abs=1.5 * cell)
        previous = result.box


def test_same_frames_give_the_same_bits(scene):
    for one, other in zip(walk(scene, 7), walk(scene, 7), strict=True):
        assert one.box == other.box and one.score == other.score and one.state == other.state
        np.testing.assert_array_equal(one.confidence_map, other.confidence_map)
        assert one.search_region == other.search_region


def test_two_trackers_do_not_share_anything(scene):
    alone = walk(scene, 5)
    first, second = LMSCOTracker(FAST), LMSCOTracker(FAST)
    first.initialize(scene.frame(CENTER), box_of())
    second.initialize(scene.frame((50, 80)), box_of((50, 80)))
    for n in range(1, 5):
        result = first.update(scene.frame((CENTER[0] + n, CENTER[1])))
        second.update(scene.frame((50 - n, 80)))
        assert result.box == alone[n].box


def test_new_start_forgets_the_former_target(scene, tracker):
    tracker.initialize(scene.frame((40.0, 90.0)), box_of((40.0, 90.0)))
    tracker.update(scene.frame((42.0, 90.0)))
    tracker.initialize(scene.frame(CENTER), box_of())
    again = tracker.update(scene.frame((CENTER[0] + 1, CENTER[1])))
    assert again.box == walk(scene, 2)[1].box


def test_colors_of_a_gray_picture_change_nothing(scene):
    def gray(image):
        return np.clip((image.astype(int) - 6800) // 4, 0, 255).astype(np.uint8)

    one = walk(scene, 4, convert=gray)
    other = walk(scene, 4, convert=lambda i: np.repeat(gray(i)[:, :, None], 3, axis=2))
    for a, b in zip(one, other, strict=True):
        assert a.box.as_tuple() == pytest.approx(b.box.as_tuple(), abs=1e-3)


def test_frames_may_be_views_in_any_memory_order(scene):
    plain = walk(scene, 4)
    strided = walk(scene, 4, convert=lambda i: np.repeat(i, 2, axis=1)[:, ::2])
    fortran = walk(scene, 4, convert=np.asfortranarray)
    for a, b, c in zip(plain, strided, fortran, strict=True):
        assert a.box == b.box == c.box


def test_a_frozen_frame_says_nothing_new(scene, tracker):
    tracker.initialize(scene.frame(CENTER), box_of())
    moved = scene.frame((CENTER[0] + 1, CENTER[1]))
    result = tracker.update(moved)
    for _ in range(8):
        again = tracker.update(moved.copy())
        assert (again.box, again.score, again.state) == (result.box, result.score, result.state)
        # But time goes on, and the target perhaps with it.
        assert np.linalg.eigvalsh(again.covariance - result.covariance).min() > 0
        result = again
    after = tracker.update(scene.frame((CENTER[0] + 2, CENTER[1])))
    assert after.box.as_tuple() == walk(scene, 3)[-1].box.as_tuple()


def test_update_needs_a_target(scene, tracker):
    with pytest.raises(NotInitializedError, match='call initialize'):
        tracker.update(later(scene))


def test_reset_forgets_the_target(scene, tracker):
    tracker.initialize(scene.frame(CENTER), box_of())
    tracker.reset()
    assert not tracker.initialized
    with pytest.raises(NotInitializedError):
        tracker.update(later(scene))
    tracker.reset()


@pytest.mark.parametrize('change', [
    lambda image: image[:-2], lambda image: image[:, :-2],
    lambda image: (image // 64).astype(np.uint8),
    lambda image: image.astype(np.float32)])
def test_frames_of_another_kind_are_refused_and_the_target_is_kept(scene, tracker, change):
    tracker.initialize(scene.frame(CENTER), box_of())
    with pytest.raises(ImageError, match='initialize again'):
        tracker.update(change(later(scene)))
    assert tracker.initialized
    result = tracker.update(later(scene))
    assert result.box.overlap(box_of()) > 0.9


def test_unusable_images_are_refused(tracker):
    for image in (np.zeros((20, 20), bool), np.zeros((4, 4), np.uint8), None):
        with pytest.raises(ImageError):
            tracker.initialize(image, box_of((10, 10), (5, 5)))
        assert not tracker.initialized


def test_frame_without_a_value_is_refused_and_the_target_is_kept(scene, tracker):
    image = scene.render(CENTER).astype(np.float32)
    tracker.initialize(image, box_of())
    with pytest.raises(ImageError, match='no finite pixel'):
        tracker.update(np.full_like(image, np.nan))
    assert tracker.update(image + np.float32(1)).box.overlap(box_of()) > 0.9


def rows_of_noise(image):
    image[:4] = np.random.default_rng(1).uniform(-3e38, 3e38, image[:4].shape)


def far_numbers(image):
    image[5::9, 3::11], image[7::9, 5::11] = 3e38, -3e38


def half(image):
    image[:, :image.shape[1] // 2] = 3e38


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('spoil', [rows_of_noise, far_numbers, half])
def test_numbers_that_no_camera_measures_count_as_none(scene, tracker, spoil):
    first, image, spoiled = (scene.render(CENTER).astype(np.float32) + n for n in range(3))
    spoil(spoiled)
    tracker.initialize(first, box_of())
    with np.errstate(over='raise', invalid='raise', divide='raise'):
        result = tracker.update(spoiled)
    assert np.isfinite(result.confidence_map).all() and 0 <= result.score <= 1
    after = tracker.update(image)
    assert after.box.overlap(box_of()) > 0.9 and after.state is TrackState.TRACKING


@pytest.mark.filterwarnings('error')
def test_frame_of_numbers_that_no_camera_measures_is_refused(scene, tracker):
    image = scene.render(CENTER).astype(np.float32)
    tracker.initialize(image, box_of())
    noise = np.random.default_rng(1).uniform(-3e38, 3e38, image.shape).astype(np.float32)
    for nonsense in (np.full_like(image, 3e38), np.where(noise > 0, 3e38, -3e38), noise):
        with pytest.raises(ImageError, match='no finite pixel'):
            tracker.update(nonsense.astype(np.float32))
    assert tracker.update(image + np.float32(1)).box.overlap(box_of()) > 0.9


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
def test_constant_image_has_nothing_to_learn(tracker, dtype):
    with pytest.raises(ImageError, match='constant around the box'):
        tracker.initialize(np.full((100, 100), 77, dtype), box_of((50, 50)))
    assert not tracker.initialized


def test_frames_without_contrast_do_no_harm(scene, tracker):
    tracker.initialize(scene.frame(CENTER), box_of())
    tracker.update(later(scene))
    for _ in range(3):
        result = tracker.update(np.full((128, 160), 7100, np.uint16))
        assert np.isfinite(result.confidence_map).all()
    assert tracker.update(later(scene)).box.overlap(box_of()) > 0.7


def test_first_frame_after_the_start_may_show_nothing(scene, tracker):
    tracker.initialize(scene.frame(CENTER), box_of())
    blank = tracker.update(np.full((128, 160), 7100, np.uint16))
    assert blank.state is TrackState.UNCERTAIN and blank.box == box_of() and blank.score == 0
    for _ in range(2):
        found = tracker.update(scene.frame((CENTER[0] + 1, CENTER[1])))
    assert found.state is TrackState.TRACKING
    assert found.box.overlap(box_of((CENTER[0] + 1, CENTER[1]))) > 0.8


def test_refused_start_says_why_and_keeps_the_former_target(scene, tracker):
    tracker.initialize(scene.frame(CENTER), box_of())
    with pytest.raises(BoxError, match='smaller than'):
        tracker.initialize(scene.frame(CENTER), BoundingBox(5, 5, 1, 1))
    with pytest.raises(BoxError, match='has 0.0% of its area in the image of 160 x 128 pixels'):
        tracker.initialize(scene.frame(CENTER), BoundingBox(500, 5, 20, 20))
    with pytest.raises(BoxError, match='larger than the image of 160 x 128 pixels; mark'):
        tracker.initialize(scene.frame(CENTER), BoundingBox(50, 5, 20, 129))
    assert tracker.update(later(scene)).box.overlap(box_of()) > 0.9


PLACES = [(x, y) for x in (2.0, 80.0, 158.0) for y in (2.0, 64.0, 126.0) if (x, y) != (80, 64)]


@pytest.mark.parametrize('place', PLACES)
def test_target_at_a_border_and_partly_outside(scene, tracker, place):
    # It stands over the border, and walks inward.
    inward = np.sign(np.array([80, 64]) - place)
    centers = [tuple(np.array(place) + n * inward) for n in range(8)]
    tracker.initialize(scene.frame(centers[0]), box_of(centers[0]))
    for center in centers[1:]:
        result = tracker.update(scene.frame(center))
    assert result.state is TrackState.TRACKING
    assert result.box.overlap(box_of(centers[-1])) > 0.6


def test_target_that_walks_out_stays_at_the_border(scene, tracker):
    tracker.initialize(scene.frame((150.0, 60.0)), box_of((150.0, 60.0)))
    for n in range(1, 16):
        result = tracker.update(scene.frame((150.0 + 3 * n, 60.0)))
        assert 0 <= result.box.center[0] <= 160 and 0 <= result.box.center[1] <= 128
        assert result.box.width < 80


@settings(max_examples=15)
@given(x=st.floats(-60, 200), y=st.floats(-60, 160), w=st.floats(0.5, 200),
       h=st.floats(0.5, 160))
def test_any_box_is_tracked_or_refused_for_a_reason(make_scene, x, y, w, h):
    track_or_refuse(make_scene(), BoundingBox(x, y, w, h))


@pytest.mark.parametrize('numbers', [
    (80, 60, 1, 1), (80, 60, 2, 2), (80, 60, 1, 40), (80, 60, 2, 120), (3, 60, 150, 2),
    (0, 0, 160, 128), (-20, -20, 200, 168), (-1, 0, 161, 60), (0, 0, 3, 3), (157, 125, 3, 3)])
def test_odd_boxes_are_tracked_or_refused_for_a_reason(scene, numbers):
    accepted = track_or_refuse(scene, BoundingBox(*numbers))
    assert accepted == (min(numbers[2:]) >= 2 and numbers[2] <= 160 and numbers[3] <= 128)


def track_or_refuse(scene, box):
    """Track a still target, or see that the refusal explains itself; return which."""
    runner = LMSCOTracker(FAST)
    try:
        runner.initialize(scene.frame(CENTER), box)
    except LMSCOError as error:
        assert len(str(error)) > 30
        assert not runner.initialized
        return False
    for n in range(2):
        result = runner.update(later(scene, n + 1))
        assert np.isfinite(result.box.as_tuple()).all()
        assert np.isfinite(result.confidence_map).all()
    assert result.box.overlap(visible_part(box, (160, 128))) > 0.45
    return True


def test_default_configuration_needs_no_argument(scene):
    runner = LMSCOTracker()
    assert runner.config == TrackerConfig.preset('default')
    runner.initialize(scene.frame(CENTER), box_of())
    assert runner.update(later(scene)).box.overlap(box_of()) > 0.9


@pytest.mark.parametrize('learning', [
    LearningConfig(loss='coupled', initial_iterations=20),
    LearningConfig(loss='ridge', initial_iterations=10),
    LearningConfig(memory_size=1, initial_iterations=10)],
    ids=['coupled', 'ridge', 'one_sample'])
def test_every_way_of_learning_tracks(scene, learning):
    config = TrackerConfig(
        features=(FeatureConfig((ChannelConfig('hog'),), 4),
                  FeatureConfig((ChannelConfig('intensity'),), 4)),
        sampling=FAST.sampling, learning=learning, search=SearchConfig(tiles=0))
    last = walk(scene, 9, config)[-1]
    assert last.box.overlap(box_of((CENTER[0] + 8, CENTER[1]))) > 0.75


@pytest.mark.parametrize('make', [LMSCOTracker, MultiTracker])
def test_target_at_a_point_is_followed(scene, make):
    tracker = make(replace(FAST, extent=ExtentConfig('extent')))
    started = tracker.initialize_at(later(scene, 0), (CENTER[0] + 3, CENTER[1] - 2))
    result = started if make is LMSCOTracker else tracker.results[started]
    assert result.box.overlap(box_of()) > 0.6
    told = tracker.update(later(scene, 1))
    result = told if make is LMSCOTracker else told[started]
    assert result.box.overlap(box_of()) > 0.6 and result.state is TrackState.TRACKING


def test_former_target_is_kept_where_nothing_is_at_a_point(scene):
    tracker = LMSCOTracker(replace(FAST, extent=ExtentConfig('extent')))
    tracker.initialize(later(scene, 0), box_of())
    empty = np.random.default_rng(2).integers(7000, 7050, later(scene).shape).astype(np.uint16)
    with pytest.raises(PointError, match='nothing stands out'):
        tracker.initialize_at(empty, CENTER)
    assert tracker.update(later(scene)).box.overlap(box_of()) > 0.6


def test_point_needs_a_network_that_measures(scene, tracker):
    with pytest.raises(ConfigError, match="set extent.network to 'extent', or give a box"):
        tracker.initialize_at(later(scene, 0), CENTER)


@pytest.mark.parametrize('preset', ['default', 'hcs'])
def test_former_target_is_freed_without_the_garbage_collector(scene, preset):
    # Tens of megabytes that would wait for a collection, which pauses and rarely comes.
    tracker = LMSCOTracker(TrackerConfig.preset(preset))
    gc.disable()
    try:
        tracker.initialize(later(scene, 0), box_of())
        # A frame without the target and one with it: everything is looked at once.
        tracker.update(scene.frame((-50, -50)))
        tracker.update(later(scene))
        former = weakref.ref(tracker._targets._tracks[1])
        tracker.initialize(later(scene, 2), box_of())
        assert former() is None
    finally:
        gc.enable()
