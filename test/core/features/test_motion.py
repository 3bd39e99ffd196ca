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

"""What the observer calls motion, and what it shows of it at every scale."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core.config import MotionConfig
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.features.optical_flow import DenseFlow, flow_image, global_motion
from lmsco_ros.core.types import BoundingBox

SIZE = 140
REGION = BoundingBox(20.3, 31.7, 90, 90)


@pytest.fixture
def ground(rng):
    """Return a texture that is larger than a patch."""
    smooth = cv2.GaussianBlur(rng.normal(size=(SIZE + 40,) * 2), (0, 0), 2.0)
    return (0.5 + 0.2 * smooth / smooth.std()).astype(np.float32)


@pytest.fixture
def figure(rng):
    """Return the texture of a target."""
    smooth = cv2.GaussianBlur(rng.normal(size=(40, 40)), (0, 0), 2.0)
    return (0.9 + 0.2 * smooth / smooth.std()).astype(np.float32)


def sight(ground, figure, at=(50, 50), pan=0):
    """Return a patch with the figure at (row, column) over the ground, moved left by `pan`."""
    patch = ground[20:20 + SIZE, 20 + pan:20 + pan + SIZE].copy()
    patch[at[0]:at[0] + 40, at[1]:at[1] + 40] = figure
    return patch


def observer(before, **settings):
    """Return an observer that has seen a patch."""
    seen = MotionObserver(MotionConfig(**settings))
    seen.remember(REGION, before)
    return seen


def test_a_moving_target_is_seen_where_it_is(ground, figure):
    seen = observer(sight(ground, figure))
    image, = seen.images(REGION, sight(ground, figure, (50, 54)), [1.0])
    assert image.shape == (SIZE, SIZE, 3) and image.dtype == np.float32
    u, v, length = np.median(image[58:82, 62:86], axis=(0, 1))
    assert (u, v, length) == pytest.approx((128 + 16 * 4, 128, 128 + 16 * 4), abs=10)
    np.testing.assert_allclose(np.median(image[:, 110:], axis=(0, 1)), 128, atol=3)


def test_nothing_is_said_before_there_was_a_frame(ground, figure):
    assert MotionObserver(MotionConfig()).images(REGION, sight(ground, figure), [1.0]) is None


@pytest.mark.parametrize('region', [
    BoundingBox(20.8, 31.7, 90, 90), BoundingBox(20.3, 30, 90, 90),
    BoundingBox(20.3, 31.7, 91, 91)])
def test_nothing_is_said_of_another_region(ground, figure, region):
    seen = observer(sight(ground, figure))
    assert seen.images(region, sight(ground, figure, (50, 54)), [1.0]) is None
    assert seen.images(REGION, sight(ground, figure, (50, 54)), [1.0]) is not None


def test_rounding_makes_no_other_region(ground, figure):
    """A box scaled by 1 goes through its center and may come back in its last bits."""
    seen = MotionObserver(MotionConfig())
    box = next(box for box in (BoundingBox(x / 7, x / 3, 30 + x / 11, 20) for x in range(1, 99))
               if box.scaled(1.0) != box)
    seen.remember(box, sight(ground, figure))
    assert seen.images(box.scaled(1.0), sight(ground, figure, (50, 54)), [1.0]) is not None


def test_frozen_frame_shows_no_motion(ground, figure):
    patch = sight(ground, figure)
    assert observer(patch).images(REGION, patch.copy(), [1.0]) is None


@pytest.mark.parametrize('noise', [0.005, 0.02])
def test_noise_over_a_still_scene_is_no_motion(rng, ground, figure, noise):
    clean = sight(ground, figure)
    patches = [clean + rng.normal(0, noise, clean.shape).astype(np.float32) for _ in range(2)]
    assert observer(patches[0]).images(REGION, patches[1], [1.0]) is None
    assert observer(patches[0], least_motion=1e-3).images(REGION, patches[1], [1.0]) is not None


def test_gain_of_the_camera_is_no_motion(ground, figure):
    patch = sight(ground, figure)
    later = np.float32(1.7) * patch - np.float32(0.3)
    assert observer(patch).images(REGION, later, [1.0]) is None


def test_motion_of_the_camera_is_taken_out(ground, figure):
    """The target stands in the middle, as a camera that follows it sees it."""
    before, after = sight(ground, figure), sight(ground, figure, pan=3)
    image, = observer(before).images(REGION, after, [1.0])
    u, v, _ = np.median(image[58:82, 58:82], axis=(0, 1))
    assert (u, v) == pytest.approx((128 + 16 * 3, 128), abs=10)
    np.testing.assert_allclose(np.median(image[:, 110:, :2], axis=(0, 1)), 128, atol=4)
    kept, = observer(before, remove_camera_motion=False).images(REGION, after, [1.0])
    np.testing.assert_allclose(np.median(kept[58:82, 58:82, :2], axis=(0, 1)), 128, atol=8)
    u, v, _ = np.median(kept[:, 110:], axis=(0, 1))
    assert (u, v) == pytest.approx((128 - 16 * 3, 128), abs=4)


def test_panning_over_a_still_scene_is_no_motion(ground):
    before, after = (ground[20:20 + SIZE, start:start + SIZE].copy() for start in (20, 22))
    assert observer(before, least_motion=0.6).images(REGION, after, [1.0]) is None
    assert observer(before, least_motion=0.6, remove_camera_motion=False).images(
        REGION, after, [1.0]) is not None


def test_each_scale_sees_the_motion_in_its_own_pixels(ground, figure):
    """Against bilinear samples of the flow, taken one by one."""
    before, after = sight(ground, figure), sight(ground, figure, (52, 53))
    factors = [0.8, 1.0, 1.25]
    images = observer(before).images(REGION, after, factors)
    assert images.shape == (3, SIZE, SIZE, 3)
    flow = DenseFlow()(before, after)
    flow = flow - global_motion(flow)
    for image, factor in zip(images, factors, strict=True):
        expected = np.zeros_like(flow)
        for row, column in [(30, 40), (70, 70), (69, 90), (100, 60), (0, 0), (139, 139)]:
            place = [(index + 0.5 - SIZE / 2) * factor + SIZE / 2 - 0.5 for index in (row, column)]
            place = np.clip(place, 0, SIZE - 1)
            top, left = np.minimum(np.floor(place).astype(int), SIZE - 2)
            dy, dx = place - (top, left)
            expected = ((1 - dy) * ((1 - dx) * flow[top, left] + dx * flow[top, left + 1])
                        + dy * ((1 - dx) * flow[top + 1, left] + dx * flow[top + 1, left + 1]))
            # Positions are rounded to a 32nd of a pixel when an image is warped.
            np.testing.assert_allclose(image[row, column],
                                       flow_image(expected[None, None] / factor)[0, 0], atol=1.5)
