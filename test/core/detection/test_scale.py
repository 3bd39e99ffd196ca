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
from lmsco_ros.core.detection.scale import found_factor, scale_factors

SEARCHED = ScaleConfig(step=1.1, exponent_min=-2, exponent_max=3)


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
