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

"""Feature channels against slow loops."""

import math

import cv2
import numpy as np
import pytest

from lmsco_ros.core.features.hog import hog, HOG_CHANNELS
from lmsco_ros.core.features.intensity_channels import intensity_channels


def cell_histograms(patch, cell):
    """Return the votes of every pixel for 18 orientations in its four nearest cells."""
    height, width = patch.shape
    result = np.zeros((height // cell, width // cell, 18))
    for y in range(height):
        for x in range(width):
            dx = patch[y, min(x + 1, width - 1)] - patch[y, max(x - 1, 0)]
            dy = patch[min(y + 1, height - 1), x] - patch[max(y - 1, 0), x]
            position = math.atan2(dy, dx) % (2 * math.pi) / (2 * math.pi) * 18
            row, column = (y + 0.5) / cell - 0.5, (x + 0.5) / cell - 0.5
            for i in (math.floor(row), math.floor(row) + 1):
                for j in (math.floor(column), math.floor(column) + 1):
                    if not (0 <= i < result.shape[0] and 0 <= j < result.shape[1]):
                        continue
                    vote = math.hypot(dx, dy) * (1 - abs(row - i)) * (1 - abs(column - j))
                    part = position - math.floor(position)
                    result[i, j, int(position) % 18] += vote * (1 - part)
                    result[i, j, (int(position) + 1) % 18] += vote * part
    return result


def slow_hog(patch, cell, noise_energy):
    """Return HOG cell by cell."""
    histogram = cell_histograms(patch, cell)
    rows, columns, _ = histogram.shape
    unsigned = histogram[..., :9] + histogram[..., 9:]
    energy = (unsigned**2).sum(axis=-1)
    result = np.zeros((rows, columns, 31))
    for i, j in np.ndindex(rows, columns):
        features = np.concatenate([histogram[i, j], unsigned[i, j]])
        for n, (di, dj) in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1)]):
            i2, j2 = min(max(i + di, 0), rows - 1), min(max(j + dj, 0), columns - 1)
            block = energy[i, j] + energy[i2, j] + energy[i, j2] + energy[i2, j2]
            truncated = np.minimum(features / math.sqrt(block + noise_energy), 0.2)
            result[i, j, :27] += 0.5 * truncated
            result[i, j, 27 + n] = 0.2357 * truncated[:18].sum()
    return result


def texture(rng, shape):
    """Return a smooth random patch."""
    return cv2.GaussianBlur(rng.normal(size=shape).astype(np.float32), (0, 0), 1.2)


@pytest.mark.parametrize('shape, cell', [((24, 24), 4), ((16, 28), 4), ((30, 18), 6),
                                         ((12, 20), 2), ((12, 16), 1)])
def test_hog_is_that_of_the_loop(rng, shape, cell):
    patch = texture(rng, shape)
    expected = slow_hog(patch.astype(float), cell, 1e-3)
    # The fast arc tangent is right to 0.3 degrees, a hundredth of a bin.
    np.testing.assert_allclose(hog(patch[None], cell, 1e-3)[0], expected, atol=4e-3)


def test_patches_do_not_touch_each_other(rng):
    patches = np.stack([texture(rng, (16, 24)) for _ in range(3)])
    together = hog(patches, 4, 1e-3)
    assert together.shape == (3, 4, 6, HOG_CHANNELS) and together.dtype == np.float32
    for i in range(3):
        np.testing.assert_allclose(together[i], hog(patches[i:i + 1], 4, 1e-3)[0], atol=1e-6)


@pytest.mark.parametrize('gain', [1e-3, 0.2, 37.0])
def test_gain_is_invisible_where_the_noise_grows_with_it(rng, gain):
    patch = texture(rng, (1, 24, 24))
    np.testing.assert_allclose(hog(np.float32(gain) * patch, 4, gain**2 * 1e-2),
                               hog(patch, 4, 1e-2), atol=1e-4)


def test_offset_is_invisible(rng):
    patch = texture(rng, (1, 24, 24))
    np.testing.assert_allclose(hog(patch + np.float32(8), 4, 1e-2), hog(patch, 4, 1e-2), atol=1e-4)


def test_noise_energy_lets_weak_structure_fade(rng):
    patch = texture(rng, (1, 24, 24))
    strong, weak = hog(patch, 4, 1e-6), hog(np.float32(1e-4) * patch, 4, 1.0)
    assert weak.max() < 1e-2 * strong.max()


def test_constant_patch_has_no_gradient():
    np.testing.assert_array_equal(hog(np.full((1, 16, 16), 0.4, np.float32), 4, 1e-4), 0)


def test_edge_votes_for_its_orientation():
    patch = np.zeros((1, 24, 24), np.float32)
    patch[:, :, 12:] = 1  # rises to the right: angle 0, first bin
    features = hog(patch, 4, 1e-4)[0, 2, 2]
    assert np.argmax(features[:18]) == 0
    assert np.argmax(hog(np.swapaxes(patch, 1, 2), 4, 1e-4)[0, 2, 2, 18:27]) in (4, 5)


def test_intensity_channels_are_cell_means_against_their_surroundings(rng):
    patch = rng.normal(size=(44, 44)).astype(np.float32)
    cells = patch.reshape(11, 4, 11, 4).mean(axis=(1, 3))
    result = intensity_channels(patch, 4)
    assert result.shape == (11, 11, 2) and result.dtype == np.float32
    np.testing.assert_allclose(result[:, :, 0], cells - np.median(cells), atol=1e-5)
    for i, j in [(0, 0), (5, 5), (10, 3)]:
        around = np.arange(-4, 5)
        window = cells[np.ix_(np.clip(i + around, 0, 10), np.clip(j + around, 0, 10))]
        assert result[i, j, 1] == pytest.approx(cells[i, j] - window.mean(), abs=1e-5)


def test_intensity_channels_know_no_offset(rng):
    patch = rng.normal(size=(20, 20)).astype(np.float32)
    np.testing.assert_allclose(intensity_channels(patch + 3, 4), intensity_channels(patch, 4),
                               atol=1e-5)
