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

"""The scale at which scores are highest, where they are few, alike or at the border."""

from dataclasses import replace

import numpy as np
import pytest

from lmsco_ros.core.config import ScaleConfig
from lmsco_ros.core.detection.scale import found_factor

CONFIG = ScaleConfig(step=1.1, exponent_min=-2, exponent_max=1, rate=1)


@pytest.mark.parametrize('scores, exponent', [
    ([1, 3, 2, 0], -1 + 1 / 6), ([0, 2, 3, 1], 0 - 1 / 6), ([0, 2, 4, 2], 0),
    ([9, 3, 2, 1], -2), ([1, 2, 3, 9], 1), ([4, 4, 4, 4], -2), ([1, 4, 4, 1], -0.5)])
def test_parabola_through_the_best_and_its_neighbors_tells_the_scale(scores, exponent):
    assert found_factor(CONFIG, np.array(scores, float)) == pytest.approx(1.1**exponent)


@pytest.mark.parametrize('rate', [0.1, 0.5])
def test_size_follows_a_part_of_the_way(rate):
    values = np.array([0, 1, 3, 5.])
    assert found_factor(replace(CONFIG, rate=rate), values) == pytest.approx(1.1**rate)


def test_better_one_of_two_scales_is_taken():
    config = ScaleConfig(step=1.1, exponent_min=0, exponent_max=1, rate=1)
    assert found_factor(config, np.array([0.4, 0.7])) == pytest.approx(1.1)
    assert found_factor(config, np.array([0.7, 0.4])) == 1.0


def test_scores_that_differ_by_rounding_alone_are_not_refined():
    """The parabola through them is flat: it has no maximum."""
    scores = np.array([0.0, np.nextafter(1.0, 0.0), 1.0, 1.0])
    assert found_factor(CONFIG, scores) == 1.0
