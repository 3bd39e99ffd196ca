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

"""Flow between textures whose motion is known, the motion they share, and its picture."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core.features.optical_flow import DenseFlow, flow_image, global_motion

MARGIN = 30


def texture(rng, size):
    """Return a smooth texture in the working range, larger than a patch of `size`."""
    smooth = cv2.GaussianBlur(rng.normal(size=(size + 2 * MARGIN,) * 2), (0, 0), 2.0)
    return (0.5 + 0.2 * smooth / smooth.std()).astype(np.float32)


def moved(picture, size, u=0.0, v=0.0):
    """Return the patch in the middle after the picture has moved right by u and down by v."""
    inverse = np.array([[1, 0, MARGIN - u], [0, 1, MARGIN - v]])
    return cv2.warpAffine(picture, inverse, (size, size),
                          flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)


def lengths(flow):
    """Return how far each pixel has moved."""
    return np.linalg.norm(flow, axis=-1)


@pytest.mark.parametrize('size', [32, 100, 140, 300])
@pytest.mark.parametrize('motion', [(1.0, 0.0), (0.0, -3.0), (2.5, -1.5), (-1.3, 2.2)])
def test_shift_of_a_texture_is_recovered(rng, size, motion):
    picture = texture(rng, size)
    flow = DenseFlow()(moved(picture, size), moved(picture, size, *motion))
    assert flow.shape == (size, size, 2) and flow.dtype == np.float32
    middle = slice(size // 4, -(size // 4))
    errors = lengths(flow[middle, middle] - np.float32(motion))
    assert np.median(errors) < 0.2 and np.percentile(errors, 95) < 0.4


def test_flow_says_where_each_pixel_of_the_later_patch_has_come_from(rng):
    """A patch of texture moves over a still one: the flow lies where it is afterward."""
    ground, figure = texture(rng, 200), texture(rng, 80)[:80, :80] + np.float32(0.3)
    before, after = moved(ground, 200), moved(ground, 200)
    before[60:140, 50:130] = figure
    after[63:143, 56:136] = figure
    flow = DenseFlow()(before, after)
    inside = slice(83, 123), slice(76, 116)
    np.testing.assert_allclose(np.median(flow[inside], axis=(0, 1)), (6, 3), atol=0.2)
    assert np.median(lengths(flow[:, 160:])) < 0.1
    y, x = np.mgrid[inside]
    u, v = np.moveaxis(flow[inside], -1, 0)
    seen = cv2.remap(before, (x - u).astype(np.float32), (y - v).astype(np.float32),
                     cv2.INTER_LINEAR)
    assert np.median(np.abs(seen - after[inside])) < 0.03
    assert np.median(np.abs(before[inside] - after[inside])) > 0.1


@pytest.mark.parametrize('gain, offset', [(1.0, 0.0), (0.4, 0.0), (3.0, -1.2), (1.0, 0.7)])
def test_gain_and_offset_are_no_motion(rng, gain, offset):
    picture = texture(rng, 100)
    before, after = moved(picture, 100), moved(picture, 100, 2.0, -1.0)
    plain = DenseFlow()(before, after)
    np.testing.assert_allclose(
        DenseFlow()(before, np.float32(gain) * after + np.float32(offset)), plain, atol=0.02)
    still = DenseFlow()(before, np.float32(gain) * before + np.float32(offset))
    assert lengths(still).max() < 0.02


def test_patches_without_contrast_do_no_harm(rng):
    flat = np.full((60, 60), 0.4, np.float32)
    picture = moved(texture(rng, 60), 60)
    for before, after in ((flat, flat), (flat, picture), (picture, flat)):
        assert np.isfinite(DenseFlow()(before, after)).all()
    np.testing.assert_array_equal(DenseFlow()(flat, flat), 0)


def affine(size, matrix):
    """Return the flow matrix @ (1, x, y) at the pixels, x and y from -1 / 2 to 1 / 2."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size - 0.5
    return np.stack([np.ones_like(x), x, y], axis=-1) @ np.array(matrix, float).T


CAMERAS = [[(0, 0, 0), (0, 0, 0)], [(3.2, 0, 0), (-1.4, 0, 0)],
           [(1, 4, -3), (-2, 3, 4)], [(-0.5, -6, 0.5), (2.5, 0.2, -6)]]


@pytest.mark.parametrize('matrix', CAMERAS)
@pytest.mark.parametrize('size', [20, 72, 140])
def test_affine_motion_without_outliers_is_recovered_exactly(matrix, size):
    flow = affine(size, matrix).astype(np.float32)
    shared = global_motion(flow)
    assert shared.dtype == np.float32
    np.testing.assert_allclose(shared, flow, atol=1e-4)


@pytest.mark.parametrize('matrix', CAMERAS)
@pytest.mark.parametrize('kind', ['scattered', 'object'])
def test_a_third_of_the_patch_does_not_bend_the_fit(rng, matrix, kind):
    size = 140
    truth = affine(size, matrix)
    flow = truth + 0.03 * rng.normal(size=truth.shape)
    if kind == 'scattered':
        wrong = rng.random((size, size)) < 0.3
        flow[wrong] = rng.uniform(-10, 10, (wrong.sum(), 2)) + (4, 0)
    else:  # Three tenths of the area
        flow[30:107, 35:111] = (7, -5)
    assert lengths(global_motion(flow.astype(np.float32)) - truth).max() < 0.15


def test_flow_image_scales_shifts_and_clips():
    flow = np.zeros((2, 3, 2), np.float32)
    flow[0] = [(1, -2), (3, 4), (100, 0)]
    flow[1] = [(0, -100), (-0.5, 0), (0, 0)]
    image = flow_image(flow)
    assert image.shape == (2, 3, 3) and image.dtype == np.float32
    np.testing.assert_allclose(image[0], [
        (144, 96, 128 + 16 * 5**0.5), (176, 192, 208), (255, 128, 255)], rtol=1e-6)
    np.testing.assert_allclose(image[1], [(128, 0, 255), (120, 128, 136), (128, 128, 128)])
