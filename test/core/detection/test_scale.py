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

"""Scale estimators on targets whose size is known."""

from dataclasses import replace
import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.config import IntensityConfig, ScaleConfig
from lmsco_ros.core.detection.scale import (
    FixedScale, make_scale_estimator, scale_factors, ScaleFilter, ScaleSearch)
from lmsco_ros.core.extent.size import credible_change, steady
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox

CONFIG = ScaleConfig(estimator='filter', step=1.03, exponent_min=-8, exponent_max=8,
                     learning_rate=0.1, model_area=512, padding=1.0, regularization=0.01,
                     label_sigma=1.0)
CENTER = (83.3, 60.7)


def scaled(size, factor):
    """Return a size, enlarged."""
    return size[0] * factor, size[1] * factor


def test_factors_are_powers_of_the_step():
    config = ScaleConfig(step=1.1, exponent_min=-2, exponent_max=3)
    assert scale_factors(config) == pytest.approx([1.1**n for n in range(-2, 4)])


@pytest.mark.parametrize('size', [(24.0, 18.0), (14.0, 33.0), (60.0, 44.0)])
def test_filter_recovers_known_changes(view, box_at, size):
    estimator = ScaleFilter(CONFIG, size)
    estimator.learn(view(size), box_at(CENTER, size))
    errors = np.array([
        estimator.estimate(view(scaled(size, factor)), box_at(CENTER, size)) / factor - 1
        for factor in np.linspace(0.96, 1.05, 10)])
    print(f'scale error of the filter at {size}: mean {np.abs(errors).mean():.4f}, '
          f'largest {np.abs(errors).max():.4f}')
    assert np.abs(errors).mean() < 0.01
    assert np.abs(errors).max() < 0.02


@pytest.mark.parametrize('factor', [1.06**-0.5, 1.06**0.5])
def test_estimate_is_refined_between_the_scales(view, box_at, factor):
    # The nearest scales are 3 % away.
    config = ScaleConfig(**{**CONFIG.__dict__, 'step': 1.06})
    estimator = ScaleFilter(config, (24.0, 18.0))
    estimator.learn(view((24.0, 18.0)), box_at(CENTER))
    estimate = estimator.estimate(view(scaled((24.0, 18.0), factor)), box_at(CENTER))
    assert estimate == pytest.approx(factor, rel=0.015)


@pytest.mark.parametrize('factor', [0.85, 0.92, 1.1, 1.18])
def test_large_changes_are_found_in_a_few_frames(view, box_at, factor):
    size = (24.0, 18.0)
    estimator = ScaleFilter(CONFIG, size)
    estimator.learn(view(size), box_at(CENTER, size))
    shown, box = view(scaled(size, factor)), box_at(CENTER, size)
    for _ in range(4):
        box = box.scaled(estimator.estimate(shown, box))
    assert box.width / size[0] == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize('rate', [1.006, 0.994])
def test_filter_follows_a_steady_change(view, box_at, rate):
    size = (24.0, 18.0)
    estimator = ScaleFilter(CONFIG, size)
    estimator.learn(view(size), box_at(CENTER, size))
    box, errors = box_at(CENTER, size), []
    for n in range(1, 41):
        shown = view(scaled(size, rate**n))
        box = box.scaled(estimator.estimate(shown, box))
        if n % 5 == 0:
            estimator.learn(shown, box)
        errors.append(abs(box.width / (size[0] * rate**n) - 1))
    assert np.mean(errors) < 0.01
    assert box.height / box.width == pytest.approx(18 / 24)


def test_credible_change_has_the_least_error_over_many_measurements(rng, box_at):
    """Changes of one percent, errors of the measurement of a third of a pixel."""
    changes = rng.normal(0, 0.01, 4000)
    for side in (8.0, 33.0, 200.0):
        measured = changes + rng.normal(0, 0.33 / side, changes.size)
        box = box_at(CENTER, (2 * side, side / 2))
        errors = [np.mean([(math.log(credible_change(math.exp(m), box, damping)) - c)**2
                           for c, m in zip(changes, measured, strict=True)])
                  for damping in (0.0, 11.0, 33.0, 100.0, 400.0)]
        assert np.argmin(errors) == 2


def test_without_damping_all_of_a_change_is_believed(box_at):
    box = box_at(CENTER, (8, 8))
    assert credible_change(1.07, box, 0.0) == pytest.approx(1.07)
    assert credible_change(1.07, box, 8.0) == pytest.approx(math.sqrt(1.07))
    assert credible_change(1.0, box, 8.0) == 1.0


def test_slow_filter_holds_on_to_the_size_that_the_fast_one_forgets(view, box_at):
    size = (24.0, 18.0)
    estimates = []
    for share in (0.0, 0.5, 1.0):
        config = replace(CONFIG, learning_rate=1.0, slow_rate=0.01, slow_share=share)
        estimator = ScaleFilter(config, size)
        estimator.learn(view(size), box_at(CENTER, size))
        # A box that is too large by a tenth is learned once.
        estimator.learn(view(size), box_at(CENTER, scaled(size, 1.1)))
        estimates.append(estimator.estimate(view(size), box_at(CENTER, scaled(size, 1.1))))
    assert estimates[0] == pytest.approx(1, abs=0.005)
    assert estimates[2] == pytest.approx(1 / 1.1, abs=0.03)
    assert estimates[2] <= estimates[1] <= estimates[0]


def test_filter_does_not_drift_on_a_static_target(view, box_at, rng):
    size = (24.0, 18.0)
    shown = view(size)
    estimator = ScaleFilter(CONFIG, size)
    estimator.learn(shown, box_at(CENTER, size))
    box = box_at(CENTER, size)
    for n in range(1, 101):
        noisy = FrameView(np.round(shown.image + 5 * rng.normal(size=shown.image.shape)).astype(
            np.uint16), shown.intensity)
        box = box.scaled(estimator.estimate(noisy, box))
        if n % 5 == 0:
            estimator.learn(noisy, box)
    assert abs(box.width / size[0] - 1) < 0.01


def test_estimates_stay_within_the_scales(view, box_at):
    size = (24.0, 18.0)
    estimator = ScaleFilter(CONFIG, size)
    estimator.learn(view(size), box_at(CENTER, size))
    for factor in (0.3, 3.0):
        estimate = estimator.estimate(view(scaled(size, factor)), box_at(CENTER, size))
        assert 1.03**-8 - 1e-9 <= estimate <= 1.03**8 + 1e-9


def test_learning_takes_over_slowly(view, box_at):
    size = (24.0, 18.0)
    estimators = []
    for rate in (0.0, 1.0):
        estimator = make_scale_estimator(
            ScaleConfig(**{**CONFIG.__dict__, 'learning_rate': rate}), size)
        estimator.learn(view(size), box_at(CENTER, size))
        # Learned as the present size: a target that is a tenth larger.
        estimator.learn(view(scaled(size, 1.1)), box_at(CENTER, size))
        estimators.append(estimator)
    larger = view(scaled(size, 1.1))
    estimates = [e.estimate(larger, box_at(CENTER, size)) for e in estimators]
    assert estimates == pytest.approx([1.1, 1.0], abs=0.02)


@pytest.mark.parametrize('center, size', [
    ((0.0, 0.0), (24.0, 18.0)), ((160.0, 128.0), (24.0, 18.0)), (CENTER, (2.0, 2.0)),
    (CENTER, (2.0, 120.0)), (CENTER, (320.0, 256.0))])
def test_odd_places_and_sizes_give_a_factor(view, box_at, center, size):
    estimator = ScaleFilter(CONFIG, size)
    shown = view(size, center)
    estimator.learn(shown, box_at(center, size))
    assert estimator.estimate(shown, box_at(center, size)) == pytest.approx(1, abs=0.01)


def test_constant_frame_leaves_the_size(box_at):
    estimator = ScaleFilter(CONFIG, (24.0, 18.0))
    image = np.full((128, 160), 7000, np.uint16)
    flat = FrameView(image, AutomaticGain(IntensityConfig()).observe(image))
    box = box_at(CENTER)
    estimator.learn(flat, box)
    assert np.isfinite(estimator.estimate(flat, box))


def test_search_leaves_the_choice_to_the_score(view, box_at):
    config = ScaleConfig(estimator='search', step=1.02, exponent_min=-4, exponent_max=5)
    estimator = make_scale_estimator(config, (24.0, 18.0))
    assert isinstance(estimator, ScaleSearch)
    assert estimator.search_factors == pytest.approx([1.02**n for n in range(-4, 6)])
    estimator.learn(view((24.0, 18.0)), box_at(CENTER))
    assert estimator.estimate(view((30.0, 22.5)), box_at(CENTER)) == 1.0


def test_fixed_scale_stays(view, box_at):
    estimator = make_scale_estimator(ScaleConfig(estimator='none'), (24.0, 18.0))
    assert type(estimator) is FixedScale
    estimator.learn(view((24.0, 18.0)), box_at(CENTER))
    assert estimator.estimate(view((30.0, 22.5)), box_at(CENTER)) == 1.0
    assert tuple(estimator.search_factors) == (1.0,)


def test_filter_searches_at_one_scale():
    assert tuple(ScaleFilter(CONFIG, (24.0, 18.0)).search_factors) == (1.0,)


SIDES = st.floats(4, 400)


@given(width=SIDES, height=SIDES, factor=st.floats(0.2, 5), tolerance=st.floats(0, 2))
def test_size_is_given_with_the_tolerance_less_of_change(width, height, factor, tolerance):
    size = (width, height)
    box = BoundingBox.from_center(CENTER, scaled(size, factor))
    given_box = steady(box, size, tolerance)
    assert given_box.center == pytest.approx(CENTER)
    assert given_box.width / given_box.height == pytest.approx(width / height)
    # Brute force: the nearest size to the first one within the tolerance of what was measured.
    side = math.sqrt(width * height)
    changes = np.linspace(-2, 2, 40001)
    within = changes[np.abs(changes - math.log(factor)) <= tolerance / side + 1e-9]
    expected = math.exp(within[np.abs(within).argmin()]) if len(within) else factor
    assert math.sqrt(given_box.area) / side == pytest.approx(expected, rel=2e-4)


def test_same_size_stays_and_noise_of_a_small_target_is_not_a_change():
    first = BoundingBox.from_center(CENTER, (12.0, 12.0))
    assert steady(first, first.size, 0.5).size == pytest.approx((12, 12))
    assert steady(first.scaled(1.03), first.size, 0.5).size == pytest.approx((12, 12))
    assert steady(first.scaled(2.0), first.size, 0.5).width == pytest.approx(23, abs=0.1)
    large = BoundingBox.from_center(CENTER, (120.0, 120.0))
    assert steady(large.scaled(1.03), large.size, 0.5).width == pytest.approx(123.1, abs=0.05)


@pytest.mark.parametrize('values, exponent', [
    ([1, 3, 2, 0], -1 + 1 / 6), ([0, 2, 3, 1], 0 - 1 / 6), ([0, 2, 4, 2], 0),
    ([9, 3, 2, 1], -2), ([1, 2, 3, 9], 1), ([4, 4, 4, 4], -2), ([1, 4, 4, 1], -0.5)])
def test_search_is_refined_by_the_parabola_through_the_best_scores(values, exponent):
    estimator = ScaleSearch(ScaleConfig(step=1.1, exponent_min=-2, exponent_max=1))
    assert estimator.found_factor(np.array(values, float)) == pytest.approx(1.1**exponent)


def test_single_score_says_nothing_of_the_scale():
    config = ScaleConfig(step=1.1, exponent_min=-2, exponent_max=1)
    for estimator in (ScaleSearch(config), FixedScale(), ScaleFilter(CONFIG, (24.0, 18.0))):
        assert estimator.found_factor(np.array([0.7])) == 1.0
    assert FixedScale().found_factor(np.array([0.7, 0.9])) == 1.0


@pytest.mark.parametrize('name, kind', [
    ('filter', ScaleFilter), ('search', ScaleSearch), ('none', FixedScale)])
def test_estimator_is_the_one_asked_for(name, kind):
    assert type(make_scale_estimator(ScaleConfig(estimator=name), (24.0, 18.0))) is kind
