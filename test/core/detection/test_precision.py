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

"""The covariance of a detection against peaks of known width and simulated noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from lmsco_ros.core import BoundingBox, TrackerConfig
from lmsco_ros.core.backend import select_backend
from lmsco_ros.core.config import ChannelConfig, FeatureConfig, SamplingConfig
from lmsco_ros.core.detection.detector import Detection, Detector
from lmsco_ros.core.detection.precision import box_covariance, center_covariance
from lmsco_ros.core.fourier.localization import locate, peak_to_sidelobe_ratio
from lmsco_ros.core.fourier.series import analyze
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.weights.loading import load_networks

SIZE, SIDE = 41, 82.0
REGION = BoundingBox(10, 20, SIDE, SIDE)
TARGET = 20.0


def hill(center, widths, height=1.0, turn=0.0):
    """Return a Gaussian around a place (x, y), in cells, of some deviations, turned."""
    t = np.arange(SIZE)
    x, y = ((t - c + SIZE / 2) % SIZE - SIZE / 2 for c in center)
    x, y = np.meshgrid(x, y)
    u, v = np.cos(turn) * x + np.sin(turn) * y, -np.sin(turn) * x + np.cos(turn) * y
    return height * np.exp(-0.5 * ((u / widths[0])**2 + (v / widths[1])**2))


def detected(score, region=REGION, noise=0.02):
    """Return the detection in a score over some noise."""
    score = score + noise * np.random.default_rng(7).normal(size=score.shape)
    series = analyze(score)
    peak = locate(series[:, :, None], SIZE, 5)
    return Detection(region, peak, [], series, peak_to_sidelobe_ratio(peak.grid, 5))


def test_covariance_is_the_width_of_the_peak_over_its_ratio():
    found = detected(hill((8, 30), (3, 2)), noise=1e-3)
    cell = SIDE / SIZE
    expected = np.square([2.5 * width * cell / found.sharpness for width in (3, 2)])
    np.testing.assert_allclose(center_covariance(found, TARGET), np.diag(expected), rtol=0.05,
                               atol=0.02 * expected.max())


def test_long_peak_is_uncertain_along_itself():
    found = detected(hill((20, 20), (4, 2), turn=np.pi / 4), noise=1e-3)
    values, axes = np.linalg.eigh(center_covariance(found, TARGET))
    assert values[1] / values[0] == pytest.approx(4, rel=0.1)
    assert abs(axes[:, 1] @ [1, 1]) == pytest.approx(2**0.5, rel=0.02)


def test_wider_region_is_less_exact():
    score = hill((20, 20), (2, 2))
    small, wide = (center_covariance(detected(score, REGION.scaled(factor)), factor * TARGET)
                   for factor in (1, 3))
    np.testing.assert_allclose(wide, 9 * small, rtol=1e-6)


def test_more_noise_is_less_exact():
    score = hill((20, 20), (3, 3))
    one, other = (np.trace(center_covariance(detected(score, noise=noise), TARGET))
                  for noise in (0.001, 0.05))
    assert other > 2 * one


@pytest.mark.parametrize('way', [(15, 0), (0, -15), (12, 12)])
def test_second_peak_makes_the_way_to_it_uncertain(way):
    place = (8, 30)
    other = tuple((p + w) % SIZE for p, w in zip(place, way))
    alone, beside = (detected(hill(place, (2, 2)) + hill(other, (2, 2), height))
                     for height in (0.0, 0.99))
    plain, told = (center_covariance(found, TARGET) for found in (alone, beside))
    pixels = np.array(way) * SIDE / SIZE
    # Both are as probable: about half of the way's square is added.
    share = (told - plain) / np.outer(pixels, pixels).clip(1e-9)
    assert 0.2 < share[np.abs(np.outer(pixels, pixels)) > 1].mean() < 0.5
    # The lower it is, the less it counts.
    lower = detected(hill(place, (2, 2)) + hill(other, (2, 2), 0.5))
    assert np.trace(center_covariance(lower, TARGET)) < 0.1 * np.trace(told)


def test_way_to_another_peak_is_weighted_by_the_chance_that_errors_changed_their_order():
    found = replace(detected(hill((20, 20), (2, 2))), sharpness=10.0)
    grid = np.full((SIZE, SIZE), 0.5)
    alone = replace(found, peak=replace(found.peak, value=1.0, grid=grid))
    grid = grid.copy()
    grid[20, 28] = 0.95
    beside = replace(alone, peak=replace(alone.peak, grid=grid))
    told = center_covariance(beside, TARGET) - center_covariance(alone, TARGET)
    # Five cells around the peak, half of the target, are its own.
    mean = 0.5 + 0.45 / (SIZE**2 - 11**2)
    chance = norm.cdf(-(1 - 0.95) / (2**0.5 * (1 - mean) / 10))
    np.testing.assert_allclose(told, np.diag([chance * (8 * SIDE / SIZE)**2, 0]), rtol=1e-6,
                               atol=1e-6)


def test_height_of_the_score_says_nothing():
    score = hill((20, 22), (3, 2)) + hill((8, 30), (2, 2), 0.9)
    one, other = (center_covariance(detected(height * score, noise=height * 0.02), TARGET)
                  for height in (1, 3))
    np.testing.assert_allclose(other, one, rtol=1e-6, atol=1e-9)


def test_peak_within_the_target_is_no_other():
    score = hill((18, 20), (1.5, 1.5)) + hill((21, 20), (1.5, 1.5), 0.97)
    near = np.trace(center_covariance(detected(score), TARGET))
    assert np.trace(center_covariance(detected(score), 2.0)) > 3 * near


@pytest.mark.parametrize('score', [
    np.zeros((SIZE, SIZE)), np.ones((SIZE, SIZE)), -hill((20, 20), (3, 3))],
    ids=['nothing', 'flat', 'hollow'])
def test_score_without_a_peak_says_little_but_something_finite(score):
    found = detected(score, noise=0.0)
    covariance = box_covariance(found, BoundingBox(30, 40, TARGET, TARGET))
    assert np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0
    assert np.sqrt(covariance[0, 0]) < SIDE


def test_peak_that_drowns_may_be_anywhere_in_the_region():
    found = replace(detected(hill((20, 20), (2, 2))), sharpness=0.01)
    values = np.linalg.eigvalsh(center_covariance(found, TARGET))
    # Along the way to the next peak it is more.
    assert values[0] == pytest.approx((0.25 * SIDE)**2) and values[1] > values[0]


@pytest.mark.parametrize('side', [SIDE, 10 * SIDE])
def test_target_that_fills_the_region_leaves_no_room_for_others(side):
    covariance = center_covariance(detected(hill((20, 20), (2, 2))), side)
    assert np.isfinite(covariance).all() and np.trace(covariance) < 1


def test_size_is_measured_to_a_part_of_itself():
    covariance = box_covariance(detected(hill((20, 20), (2, 2))), BoundingBox(30, 40, 30, 10))
    assert np.diag(covariance)[2:] == pytest.approx([0.6**2, 0.2**2])
    assert not covariance[:2, 2:].any() and not covariance[2, 3]


@pytest.mark.parametrize('noise', [20, 60, 150])
def test_errors_in_noise_are_about_as_large_as_they_are_told_to_be(make_scene, noise):
    config = TrackerConfig(
        features=(FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity')), 4),),
        sampling=SamplingConfig(4.0, 84, 84, newton_steps=5))
    scene, target, start = make_scene(), (24.0, 18.0), (60.3, 60.7)
    rng = np.random.default_rng(2)

    def view(center):
        return FrameView(scene.render(center) + rng.normal(0, noise, (128, 160)),
                         IntensityRange(6700, 7900))
    box = BoundingBox.from_center(start, target)
    detector = Detector(config, select_backend('cpu'), load_networks(config), view(start), box)
    errors = []
    for _ in range(25):
        center = tuple(np.array(start) + rng.uniform(-6, 6, 2))
        found = detector(view(center), box)
        error = np.array(found.center) - center
        errors.append(error @ np.linalg.solve(center_covariance(found, 20.8), error) / 2)
    # The tracker learns from what it sees, which adds errors of its own.
    assert 0.02 < np.mean(errors) < 2
