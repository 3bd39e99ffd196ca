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

"""Scales that are searched, and where the target is found among them."""

import numpy as np
import pytest

from lmsco_ros.core.config import ScaleConfig
from lmsco_ros.core.detection.scale import found_factor, scale_factors, score_slope

SEARCHED = ScaleConfig(step=1.1, exponent_min=-2, exponent_max=3, rate=1)


def parabola(peak):
    """Return scores over the scales that are highest at a factor."""
    exponents = np.arange(SEARCHED.exponent_min, SEARCHED.exponent_max + 1)
    return 1 - 0.03 * (exponents - np.log(peak) / np.log(SEARCHED.step))**2


def test_factors_are_powers_of_the_step():
    assert scale_factors(SEARCHED) == pytest.approx([1.1**n for n in range(-2, 4)])


def test_the_last_size_alone_is_searched_unless_more_is_asked_for():
    assert scale_factors(ScaleConfig()) == (1.0,)


@pytest.mark.parametrize('factor', [0.87, 1.0, 1.04, 1.2])
def test_maximum_is_refined_between_the_scales(factor):
    assert found_factor(SEARCHED, parabola(factor)) == pytest.approx(factor)


@pytest.mark.parametrize('factor, best', [(0.5, 1.1**-2), (2.0, 1.1**3)])
def test_factor_stays_within_the_scales(factor, best):
    assert found_factor(SEARCHED, parabola(factor)) == pytest.approx(best)


def test_equal_scores_give_the_smallest_scale_unrefined():
    assert found_factor(SEARCHED, np.ones(6)) == pytest.approx(1.1**-2)


def test_one_score_says_nothing_of_the_scale():
    assert found_factor(SEARCHED, np.array([0.4])) == 1.0


@pytest.mark.parametrize('slope', [-1.2, 0.0, 0.7])
def test_slope_is_that_at_the_size_of_the_target(slope):
    """Of a score that falls off to both sides, whatever its height."""
    def score(factor):
        return 0.3 * np.exp(slope * np.log(factor) - 4 * np.log(factor)**2)
    found = score_slope(SEARCHED.step, score(1 / SEARCHED.step), score(SEARCHED.step))
    assert found == pytest.approx(slope)
    # What counts by it is highest at the right size, in this frame and in one of another size.
    factors = np.array(scale_factors(SEARCHED))
    for size in (1.0, 1.1**1.4):
        calibrated = score(factors / size) * factors**-found
        assert found_factor(SEARCHED, calibrated) == pytest.approx(size, rel=1e-3)


@pytest.mark.parametrize('smaller, larger', [(-0.1, 0.6), (0.6, 0.0), (-1.0, -2.0)])
def test_slope_of_scores_that_are_none_is_finite(smaller, larger):
    assert abs(score_slope(1.1, smaller, larger)) < 30
