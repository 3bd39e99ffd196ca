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

"""Where the filter sees a target whose place is known, and what it makes of other peaks."""

from dataclasses import replace
from unittest.mock import create_autospec, Mock

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, ImageError, TrackerConfig
from lmsco_ros.core.config import ChannelConfig, FeatureConfig, LearningConfig, SamplingConfig
from lmsco_ros.core.detection import detector as detector_module
from lmsco_ros.core.detection.detector import Detection, Detector
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.fourier.localization import Peak, peak_to_sidelobe_ratio
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.regions import region_around
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from lmsco_ros.core.weights.loading import load_networks, Networks

CENTER, SIZE = (80.3, 60.4), (24.0, 18.0)
BOX = BoundingBox.from_center(CENTER, SIZE)
SMALL = TrackerConfig(
    features=(FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity')), 4),),
    sampling=SamplingConfig(4.0, 84, 84, newton_steps=5),
    learning=LearningConfig(initial_iterations=5))


def view(image):
    """Return a frame in the range of the scenes."""
    return FrameView(image, IntensityRange(6900, 7600))


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene()


@pytest.fixture
def make_detector(scene, backend):
    """Return a maker of detectors that have seen the target in its first frame."""
    return lambda config=SMALL, networks=Networks(): Detector(
        config, backend, networks, view(scene.frame(CENTER)), BOX)


@pytest.fixture
def detector(make_detector):
    return make_detector()


def with_twin(scene, center, twin):
    """Return a frame with the target and a copy of it."""
    alone, empty = scene.render(center), scene.render()
    moved = [round(b - a) for a, b in zip(center, twin, strict=True)]
    return view(np.round(alone + np.roll(alone - empty, moved[::-1], axis=(0, 1))))


def test_positions_and_displacements_are_each_others_inverse():
    region = BoundingBox(10, 20, 100, 50)
    peak = Peak((0.1, -0.2), 0, 1.0, np.zeros((3, 3)), np.ones(1))
    detection = Detection(region, peak, [], np.zeros((3, 2)), 1.0)
    assert detection.center == pytest.approx((60 - 20, 45 + 5))
    assert detection.image_position((0.0, 0.5)) == pytest.approx((110, 45))
    assert detection.displacement_to(detection.center) == pytest.approx((0.1, -0.2))


@pytest.mark.parametrize('preset', [False, True], ids=['small', 'default'])
@pytest.mark.parametrize('moved', [(0.0, 0.0), (5.7, -4.1)])
def test_target_is_seen_where_it_is(make_detector, scene, preset, moved):
    config = TrackerConfig.preset('default') if preset else SMALL
    detector = make_detector(config, load_networks(config))
    center = (CENTER[0] + moved[0], CENTER[1] + moved[1])
    detection = detector(view(scene.frame(center)), BOX)
    assert detection.center == pytest.approx(center, abs=0.6)
    assert detection.region == region_around(BOX, config.sampling)


def test_best_scale_wins(detector, scene):
    frame = view(scene.frame(CENTER, (24 * 1.2, 18 * 1.2), pan=(-0.2 * 80.3, -0.2 * 60.4),
                             zoom=1.2))
    factors = (0.8, 1.0, 1.2)
    detection = detector(frame, BOX, factors)
    assert detection.peak.scale_index == 2
    assert detection.region == region_around(BOX.scaled(1.2), SMALL.sampling)
    # Sample and scores are those of the same scale.
    alone = detector(frame, BOX.scaled(1.2))
    for block, other in zip(detection.sample, alone.sample, strict=True):
        np.testing.assert_allclose(block, other, atol=1e-6)
    np.testing.assert_allclose(detection.scores, alone.scores, atol=1e-6)
    assert detection.peak.value == pytest.approx(alone.peak.value)


def test_sharpness_leaves_out_what_belongs_to_the_target(detector, scene):
    detection = detector(view(scene.frame(CENTER)), BOX)
    grid = detection.peak.grid
    # The target is a quarter of the region, and the square around its peak half of that.
    assert detection.sharpness == peak_to_sidelobe_ratio(grid, round(len(grid) / 8))
    assert detection.sharpness > 5


def test_peak_is_refined_between_the_points_of_the_grid(detector, evaluate, scene):
    detection = detector(view(scene.frame((82.1, 61.9))), BOX)
    ty, tx = detection.peak.displacement
    assert detection.peak.value == pytest.approx(evaluate(detection.scores, ty, tx))
    around = [evaluate(detection.scores, ty + dy, tx + dx)
              for dy in (-1e-3, 1e-3) for dx in (-1e-3, 1e-3)]
    assert detection.peak.value > max(around)


@pytest.mark.parametrize('beside', [(0.0, 0.0), (2.5, -1.5)], ids=['peak', 'beside it'])
def test_sample_has_a_place_at_its_origin(detector, scene, evaluate, beside):
    detection = detector(view(scene.frame((83.0, 58.0))), BOX)
    center = tuple(np.add(detection.center, beside))
    ty, tx = detection.displacement_to(center)
    for block, moved in zip(detection.sample, detection.sample_around(center), strict=True):
        for y, x in ((0.0, 0.0), (0.2, -0.3)):
            assert evaluate(moved[..., 0], y, x) == pytest.approx(
                evaluate(block[..., 0], y + ty, x + tx), abs=1e-6)


def test_first_filter_says_of_its_own_frame_what_the_score_says(detector, scene):
    detection = detector(view(scene.frame(CENTER)), BOX)
    assert detector.likeness(detection) == pytest.approx(detection.peak.value, rel=1e-6)


def test_first_filter_never_changes(detector, scene, make_scene):
    first, other = view(scene.frame(CENTER)), view(make_scene(seed=8).frame(CENTER))
    detection = detector(first, BOX)
    likeness = detector.likeness(detection)
    for _ in range(8):
        seen = detector(other, BOX)
        detector.remember(seen, seen.center)
        detector.train()
    assert detector.likeness(detection) == likeness
    # While the one that learns does.
    assert detector(other, BOX).peak.value > 1.2 * detector.likeness(detector(other, BOX))


def test_likeness_is_that_of_the_peak(detector, scene, evaluate):
    detection = detector(view(scene.frame((84.0, 62.0))), BOX)
    ty, tx = detection.peak.displacement
    assert detector.likeness(detection) == pytest.approx(evaluate(detection.scores, ty, tx))


def test_likeness_is_that_of_the_place_even_beside_a_maximum(detector, scene, evaluate):
    """The filter that learns says where the target is; the first one has no say in that."""
    detection = detector(view(scene.frame(CENTER)), BOX)
    ty, tx = detection.peak.displacement
    ty, tx = ty + 0.02, tx - 0.03
    beside = replace(detection, peak=replace(detection.peak, displacement=(ty, tx)))
    likeness = detector.likeness(beside)
    assert likeness == pytest.approx(evaluate(detection.scores, ty, tx))
    assert likeness < 0.95 * detector.likeness(detection)


def test_filter_learns_what_it_is_given_only_when_it_trains(detector, make_scene):
    other = view(make_scene(seed=8).frame(CENTER))
    detection = detector(other, BOX)
    detector.remember(detection, detection.center)
    assert detector(other, BOX).peak.value == detection.peak.value
    detector.train()
    assert detector(other, BOX).peak.value > detection.peak.value


@pytest.mark.parametrize('offset', [(0.0, 0.0), (5.0, -4.0)], ids=['its peak', 'beside it'])
def test_target_is_learned_where_it_is_known_to_be(detector, make_scene, offset):
    """As far off the place it is seen at later as its center was off the peak."""
    other = make_scene(seed=8)
    moved = detector(view(other.frame((CENTER[0] + 6, CENTER[1] - 4))), BOX)
    center = (CENTER[0] + 6 + offset[0], CENTER[1] - 4 + offset[1])
    for _ in range(10):
        detector.remember(moved, center)
        detector.train()
    seen = detector(view(other.frame(CENTER)), BOX)
    assert seen.center == pytest.approx(np.add(CENTER, offset), abs=1.5)


def test_peak_near_a_place_is_found_beside_a_higher_one(detector, scene, evaluate):
    twin = (CENTER[0] + 22, CENTER[1] - 15)
    frame = with_twin(scene, CENTER, twin)
    # The window dims the target at the place itself less than the twin: look at the twin first.
    detection = detector(frame, BOX.moved_to(twin))
    assert detection.center == pytest.approx(twin, abs=1)
    near = detector.near(detection, CENTER)
    assert near.center == pytest.approx(CENTER, abs=2)
    ty, tx = near.peak.displacement
    assert -0.5 <= ty < 0.5 and -0.5 <= tx < 0.5
    assert near.peak.value == pytest.approx(evaluate(detection.scores, ty, tx))
    # It is as much less sharp as it is lower, in the same score.
    assert near.peak.value < detection.peak.value
    assert near.sharpness == pytest.approx(
        detection.sharpness * near.peak.value / detection.peak.value)
    assert near.peak.grid is detection.peak.grid and near.region == detection.region
    assert near.sample is detection.sample


def test_peak_near_itself_is_the_same(detector, scene):
    detection = detector(view(scene.frame((83.0, 58.0))), BOX)
    near = detector.near(detection, (84.0, 59.0))
    assert near.peak.displacement == pytest.approx(detection.peak.displacement, abs=1e-6)
    assert near.sharpness == pytest.approx(detection.sharpness)


@pytest.fixture
def ridged(detector, scene):
    """Return a detection whose score is a ridge that falls away from the right border."""
    detection = detector(view(scene.frame(CENTER)), BOX)
    size = detection.peak.grid.shape[0]
    rows, columns = np.indices((size, size))
    grid = 100.0 * columns + rows
    return grid, size, Detection(
        BoundingBox(0, 0, size, size), Peak((0.0, 0.4), 0, 1.0, grid, np.ones(1)),
        detection.sample, np.zeros((3, 2)), 5.0)


@pytest.mark.parametrize('row, column', [(0, 0), (5, 3), (-4, 7), (9, -6)])
def test_half_a_target_around_a_place_is_searched(detector, ridged, row, column):
    """The score that is refined is flat, so the highest point of the grid is where it ends."""
    grid, size, detection = ridged
    reach = round(size / 8)
    x, y = detection.region.center
    near = detector.near(detection, (x + column, y + row))
    around = np.arange(-reach, reach + 1)
    square = grid[np.ix_((row + around) % size, (column + around) % size)]
    value = square.max()
    best = (value % 100 / size, value // 100 / size)
    wrapped = tuple((t + 0.5) % 1 - 0.5 for t in best)
    assert near.peak.displacement == pytest.approx(wrapped)


def test_peak_near_a_place_is_one_that_comes_into_question(detector, ridged):
    """The highest points lie at the last indices, which are left of and above the middle."""
    grid, size, detection = ridged
    reach, (x, y) = round(size / 8), detection.region.center
    near = detector.near(detection, (x, y), lambda places: places[..., 0] > x - 0.5)
    assert near.center == pytest.approx((x + reach, y - 1))


def test_peak_does_not_leave_what_comes_into_question(detector, scene):
    """Climbing from the border leads to the target, which is out of question."""
    detection = detector(view(scene.frame((83.0, 58.0))), BOX)
    near = detector.near(detection, (83.0, 58.0), lambda places: places[..., 0] < 81.3)
    assert near.center[0] < 81.3 and near.center[1] == pytest.approx(58, abs=3)
    assert near.peak.value < detection.peak.value


def test_at_least_the_next_points_of_the_grid_are_searched(make_detector, ridged):
    """A target of less than a point of the grid."""
    config = TrackerConfig(features=SMALL.features, learning=SMALL.learning,
                           sampling=SamplingConfig(10.0, 84, 84))
    grid = np.zeros((4, 4))
    grid[1, 1], grid[2, 2] = 1.0, 2.0
    detection = Detection(BoundingBox(0, 0, 4, 4), Peak((0.5, 0.5), 0, 2.0, grid, np.ones(1)),
                          ridged[2].sample, np.zeros((3, 2)), 5.0)
    near = make_detector(config).near(detection, detection.region.center)
    assert near.peak.displacement == (0.25, 0.25)


def test_constant_surroundings_are_refused(backend):
    flat = view(np.full((128, 160), 7000, np.uint16))
    with pytest.raises(ImageError, match='constant around the box'):
        Detector(SMALL, backend, Networks(), flat, BOX)


def test_least_contrast_is_enough(backend):
    image = np.full((128, 160), 7000, np.uint16)
    image[55:65, 75:85] += 1
    detection = Detector(SMALL, backend, Networks(), view(image), BOX)(view(image), BOX)
    assert np.isfinite(detection.peak.value)


def test_filter_is_made_for_the_shape_of_the_target(monkeypatch, make_detector, backend):
    operator = create_autospec(StructuredOperator, instance=True)
    operator.filters = [np.ones((3, 2, 1))]
    made = Mock(return_value=operator)
    monkeypatch.setattr(detector_module, 'StructuredOperator', made)
    make_detector()
    config, sample, target, given = made.call_args.args
    assert config is SMALL.learning and given is backend
    side = 4 * np.sqrt(24 * 18)
    assert target == pytest.approx((18 / side, 24 / side))
    assert [block.ndim for block in sample] == [3]


MOVING = TrackerConfig(
    features=(*SMALL.features, FeatureConfig((ChannelConfig('motion', layer='deep'),), 4)),
    sampling=SMALL.sampling, learning=SMALL.learning)


@pytest.fixture
def motion(monkeypatch):
    """Replace what is said of motion; nothing moves."""
    motion = create_autospec(MotionObserver, instance=True)
    motion.images.return_value = None
    monkeypatch.setattr(detector_module, 'MotionObserver', Mock(return_value=motion))
    return motion


def test_expected_place_is_watched_for_motion(make_detector, scene, random_weights, motion):
    detector = make_detector(MOVING, load_networks(MOVING))
    frame, box = view(scene.frame(CENTER)), BOX.moved_to((70, 50))
    detector.watch(frame, box)
    region, patch = motion.remember.call_args.args
    assert region == region_around(box, SMALL.sampling)
    np.testing.assert_array_equal(patch, frame.patch(region, (84, 84)))
    assert motion.remember.call_count == 1


def test_motion_is_that_of_the_unscaled_region(make_detector, scene, random_weights, motion):
    detector = make_detector(MOVING, load_networks(MOVING))
    frame, factors = view(scene.frame(CENTER)), (0.8, 1.0, 1.25)
    detector(frame, BOX, factors)
    region, patch, given = motion.images.call_args.args
    assert region == region_around(BOX, SMALL.sampling) and given == factors
    np.testing.assert_array_equal(patch, frame.patch(region, (84, 84)))


@pytest.mark.parametrize('group', [ChannelConfig('motion', layer='deep'),
                                   ChannelConfig('motion', layer='shallow'),
                                   ChannelConfig('flow')], ids=['deep', 'shallow', 'flow'])
def test_motion_takes_part_in_the_score(make_detector, scene, random_weights, motion, group):
    config = replace(MOVING, features=(*SMALL.features, FeatureConfig((group,), 4)))
    detector = make_detector(config, load_networks(config))
    frame = view(scene.frame(CENTER))
    rest = detector(frame, BOX)
    assert not np.any(rest.sample[1])
    motion.images.return_value = np.ones((1, 84, 84, 3), np.float32)
    assert np.any(detector(frame, BOX).sample[1])


def test_nothing_is_watched_without_motion_channels(detector, scene, motion):
    detector.watch(view(scene.frame(CENTER)), BOX)
    motion.remember.assert_not_called()
    detector_module.MotionObserver.assert_not_called()
