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

"""Training examples show the target where their offsets say, however they were made."""

import itertools

import numpy as np
import pytest

from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox
from training import examples
from training.degradations import degrade, occlude
from training.examples import Example, ExampleSource, jitter, offset_of, Spread
from training.features import feature_batches
from training.flow_examples import FlowSource
from training.sources import Clip

EXACT = Spread(0.0, 0.0, 0.0)
WIDE = Spread(0.5, 0.15, 0.15)
NEAR, FAR = Spread(0.3, 0.1, 0.1), Spread(2.5, 0.2, 0.1)
# Standard deviation of the spot over the sides of its box, see conftest.
SPOT = 0.15


@pytest.fixture
def plain(monkeypatch):
    """Leave the patches as they are sampled, and the targets in one piece."""
    monkeypatch.setattr(examples, 'degrade', lambda patch, rng: patch)
    monkeypatch.setattr(examples, 'occlude', lambda patch, target, rng: patch)
    monkeypatch.setattr(examples, '_bent', lambda image, box, rng: image)
    monkeypatch.setattr(ExampleSource, '_transplant', lambda self, patch, *others: patch)


@pytest.mark.parametrize('square, factor', [(True, 5.0), (False, 3.0)])
@pytest.mark.parametrize('share', [0.0, 1.0], ids=['still', 'clip'])
def test_offsets_say_where_the_target_is_and_how_large(
        plain, clip, still, moments, square, factor, share):
    size = 100
    source = ExampleSource([clip], [still], size, factor, square, share)
    turned = set()
    for seed in range(25):
        example = source.draw(3, EXACT, WIDE, np.random.default_rng(seed))
        assert example.patches.shape == (3, size, size) and example.patches.dtype == np.float32
        assert example.offsets.shape == (3, 4) and example.offsets.dtype == np.float32
        np.testing.assert_allclose(example.offsets[:2], 0, atol=1e-6)
        assert np.abs(example.offsets[2, :2]).max() > 0
        turned.add((np.median(example.patches) > 0.5, *(example.offsets[2, :2] > 0)))
        for patch, offset in zip(example.patches, example.offsets, strict=True):
            middle, spread = moments(patch)
            np.testing.assert_allclose(middle, size * (0.5 + offset[:2] / factor), atol=0.25)
            # Of a box as large as the guess, the spot would be SPOT times its sides.
            per_side = size / factor * np.exp(offset[2:])
            ratio = spread[0] / per_side[0], spread[1] / per_side[1]
            if square:
                # The region has the mean side of the guess: only the area is told.
                assert np.sqrt(ratio[0] * ratio[1]) == pytest.approx(SPOT, rel=0.1)
            else:
                assert ratio == pytest.approx((SPOT, SPOT), rel=0.1)
    # Warm and cold, to all sides.
    assert len(turned) >= 6


def test_guesses_are_off_by_what_the_spread_says():
    box = BoundingBox.from_center((50, 60), (40, 10))
    rng = np.random.default_rng(1)
    guesses = [jitter(box, Spread(0.5, 0.2, 0.1), rng) for _ in range(4000)]
    shifts = np.array([guess.center for guess in guesses]) - box.center
    assert np.abs(shifts).max() <= 0.5 * 20 and np.abs(shifts).max() > 0.49 * 20
    areas = np.log([guess.area / box.area for guess in guesses]) / 2
    aspects = np.log([guess.width / guess.height / 4 for guess in guesses])
    assert (areas.std(), aspects.std()) == pytest.approx((0.2, 0.1), rel=0.1)
    assert jitter(box, EXACT, rng).as_tuple() == pytest.approx(box.as_tuple())


def test_offsets_are_zero_for_the_box_itself_and_count_in_sides():
    box = BoundingBox.from_center((50, 60), (40, 10))
    assert offset_of(box, box, (40, 10)) == (0, 0, 0, 0)
    guess = BoundingBox.from_center((40, 62), (20, 20))
    assert offset_of(box, guess, (20, 20)) == pytest.approx(
        (0.5, -0.1, np.log(2), -np.log(2)))


def test_box_follows_a_moved_image(plain, spot, moments):
    """The center to a fiftieth of a pixel, the size by the area of the spot."""
    center, target = (90.3, 81.6), (40.0, 30.0)
    image = spot(center, target).astype(np.float32)
    box = BoundingBox.from_center(center, target)
    view = FrameView(image, IntensityRange(0, 255))
    _, before = moments(image)
    factors = []
    for seed in range(10):
        moved, its_box = examples.moved(view, box, np.random.default_rng(seed))
        assert moved.intensity == view.intensity
        assert moved.image.shape == image.shape and not np.array_equal(moved.image, image)
        middle, spread = moments(moved.image)
        np.testing.assert_allclose(middle, its_box.center, atol=0.02)
        factors.append((its_box.area / box.area)**0.5)
        assert np.sqrt(np.prod(spread) / np.prod(before)) == pytest.approx(factors[-1], rel=0.02)
    assert min(factors) < 0.9 and max(factors) > 1.1


@pytest.mark.parametrize('center', [(90.3, 81.6), (4.0, 3.0), (197.5, 158.0)])
def test_only_what_is_near_the_target_bends(rng, center):
    image = rng.integers(0, 255, (160, 200)).astype(np.uint8)
    kept = image.copy()
    box = BoundingBox.from_center(center, (40.0, 30.0))
    bent = examples._bent(image, box, rng)
    assert bent.shape == image.shape and bent.dtype == image.dtype
    np.testing.assert_array_equal(image, kept)
    rows, columns = np.nonzero(bent != image)
    assert len(rows) > 100
    assert np.abs(columns + 0.5 - center[0]).max() <= 41
    assert np.abs(rows + 0.5 - center[1]).max() <= 31


def test_a_transplanted_target_stays_in_place_before_another_background(clip, rng):
    size, factor = 100, 4.0
    source = ExampleSource([clip], [], size, factor, True, 1.0)
    box = BoundingBox.from_center((80, 70), (36, 24))
    guess = BoundingBox.from_center((90, 66), (40, 24))
    patch = rng.random((size, size)).astype(np.float32)
    dark = FrameView(np.zeros((160, 200), np.uint8), IntensityRange(0, 255))
    found = source._transplant(patch, box, guess, (dark, box), rng)
    assert found.dtype == np.float32 and found.shape == patch.shape
    x, y, *_ = offset_of(box, guess, (guess.area**0.5,) * 2)
    middle = size * (0.5 + np.array([x, y]) / factor)
    sides = np.array(box.size) / guess.area**0.5 * size / factor
    axis = np.arange(size) + 0.5
    away = np.hypot((axis[None, :] - middle[0]) / sides[0], (axis[:, None] - middle[1]) / sides[1])
    np.testing.assert_array_equal(found[away < 0.5], patch[away < 0.5])
    np.testing.assert_array_equal(found[away > 0.7], 0)
    assert (found[away > 0.7].size, found[away < 0.5].size) > (5000, 100)


def test_mirror_images_mirror_patches_and_offsets_alike(rng):
    example = Example(rng.random((2, 5, 5)).astype(np.float32),
                      rng.normal(size=(2, 4)).astype(np.float32))
    kept = example.offsets.copy()
    mirrored = {}
    for seed in range(20):
        found = examples._flip(example, np.random.default_rng(seed))
        signs = tuple(np.sign(found.offsets / example.offsets)[0, :2])
        mirrored[signs] = found
        assert found.patches.flags.c_contiguous
    assert set(mirrored) == set(itertools.product((-1, 1), repeat=2))
    for (x, y), found in mirrored.items():
        np.testing.assert_array_equal(found.patches, example.patches[:, ::int(y), ::int(x)])
        np.testing.assert_array_equal(found.offsets, kept * (x, y, 1, 1))
    np.testing.assert_array_equal(example.offsets, kept)


def test_frames_without_the_target_are_never_drawn(plain, clip):
    """They are white, so that a patch of one would be."""
    source = ExampleSource([clip], [], 60, 3.0, True, 0.0)
    for seed in range(30):
        for patch in source.draw(2, EXACT, EXACT, np.random.default_rng(seed)).patches:
            assert np.ptp(patch) > 0.5


def same(one, other):
    """Return whether two examples are equal bit for bit."""
    return (np.array_equal(one.patches, other.patches)
            and np.array_equal(one.offsets, other.offsets))


@pytest.mark.parametrize('share', [0.0, 1.0], ids=['still', 'clip'])
def test_seeds_make_two_draws_equal(clip, still, share):
    source = ExampleSource([clip], [still], 50, 4.0, True, share)
    one, again, other = (source.draw(3, EXACT, WIDE, np.random.default_rng(seed))
                         for seed in (5, 5, 6))
    assert same(one, again) and not same(one, other)


def test_seeds_make_two_runs_of_batches_equal(clip, still):
    source = ExampleSource([clip], [still], 40, 4.0, True, 0.5)
    runs = [feature_batches(source, 3, 2, WIDE, seed) for seed in (1, 1, 2)]
    for _ in range(2):
        one, again, other = (next(run) for run in runs)
        assert one.inputs.equal(again.inputs) and one.targets.equal(again.targets)
        assert not one.targets.equal(other.targets)
        assert one.inputs.shape[2:] == (1, 40, 40)
        assert len(one.inputs) == len(one.targets)


def test_flow_is_seen_where_the_offsets_say(rng):
    """A textured target moves over a textured ground that stands."""
    ground = rng.integers(60, 120, (160, 200)).astype(np.uint8)
    target = rng.integers(140, 255, (40, 40)).astype(np.uint8)
    frames, boxes = [], []
    for n in range(12):
        frame = ground.copy()
        frame[60:100, 50 + 5 * n:90 + 5 * n] = target
        frames.append(frame)
        boxes.append((50 + 5 * n, 60, 40, 40))
    clip = Clip('made/up', np.stack(frames), np.array(boxes, float))
    source = FlowSource([clip], 140, 4.0)
    example = source.draw(6, EXACT, Spread(0.8, 0.1, 0.0), rng)
    assert example.patches.shape == (6, 140, 140, 3)
    for image, offset in zip(example.patches, example.offsets, strict=True):
        length = image[..., 2] - 128
        length[length < 0.5 * length.max()] = 0
        y, x = np.mgrid[:140, :140] + 0.5
        middle = np.array([np.sum(length * axis) / length.sum() for axis in (x, y)])
        np.testing.assert_allclose(middle, 140 * (0.5 + offset[:2] / 4.0), atol=10)
    again = source.draw(3, EXACT, EXACT, np.random.default_rng(2))
    assert same(again, source.draw(3, EXACT, EXACT, np.random.default_rng(2)))


@pytest.mark.parametrize('size', [32, 100])
def test_degradations_keep_shape_and_type(size):
    patch = np.random.default_rng(3).random((size, size)).astype(np.float32)
    kept = patch.copy()
    changed = []
    for seed in range(40):
        worse = degrade(patch, np.random.default_rng(seed))
        assert worse.shape == patch.shape and worse.dtype == np.float32
        assert np.isfinite(worse).all()
        np.testing.assert_array_equal(worse, degrade(patch, np.random.default_rng(seed)))
        hidden = occlude(patch, size / 5, np.random.default_rng(seed))
        assert hidden.shape == patch.shape and hidden.dtype == np.float32
        changed.append(not np.array_equal(worse, patch))
    np.testing.assert_array_equal(patch, kept)
    assert 0.6 < np.mean(changed) < 1


def test_degradations_do_not_move_the_target(spot, moments):
    """Neither does the blur of a motion, whatever its direction."""
    from training.degradations import _motion_blur
    patch = spot((50.2, 49.7), (16, 16), (100, 100)).astype(np.float32) / 255
    middle, spread = moments(patch)
    smeared = set()
    for seed in range(40):
        blurred = _motion_blur(patch, np.random.default_rng(seed))
        assert blurred.dtype == np.float32
        found, wider = moments(blurred)
        np.testing.assert_allclose(found, middle, atol=0.05)
        smeared.add(tuple((wider > spread + 0.08).tolist()))
    assert smeared >= {(True, False), (False, True), (True, True)}


def test_occlusion_hides_a_part_of_the_target_alone(rng):
    patch = rng.random((100, 100)).astype(np.float32)
    for seed in range(30):
        hidden = occlude(patch, 20.0, np.random.default_rng(seed)) != patch
        rows, columns = (np.flatnonzero(hidden.any(axis=axis)) for axis in (1, 0))
        assert hidden[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1].mean() > 0.99
        for places in (rows, columns):
            assert 6 <= np.ptp(places) + 1 <= 16
            assert 50 - 0.7 * 20 - 1 <= places[0] and places[-1] <= 50 + 0.3 * 20 + 16
