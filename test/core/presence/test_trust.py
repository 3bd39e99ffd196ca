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

"""The probability that a detection is the target."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.presence.trust import trust


@given(quality=st.floats(0.01, 6), likeness=st.floats(-1, 2), more=st.floats(0, 2),
       presence=st.one_of(st.none(), st.floats(-20, 20)))
def test_trust_is_a_probability_that_grows_with_each_hint(quality, likeness, more, presence):
    one = trust(quality, likeness, presence)
    assert 0 < one < 1
    assert trust(quality + more, likeness, presence) >= one
    assert trust(quality, likeness + more, presence) >= one
    if presence is not None:
        assert trust(quality, likeness, presence + more) >= one


def test_trust_is_the_logistic_function_of_the_weighted_hints():
    odds = 1.26 * np.log(0.5) + 1.53 * 0.8 + 0.42 * 1.5 + 1.81
    assert trust(0.5, 0.8, 1.5) == pytest.approx(1 / (1 + np.exp(-odds)))
    odds = 2.09 * np.log(0.5) + 2.23 * 0.8 + 2.47
    assert trust(0.5, 0.8, None) == pytest.approx(1 / (1 + np.exp(-odds)))


def test_values_that_are_no_numbers_speak_against_the_target():
    assert trust(1.0, float('nan'), float('nan')) == trust(1.0, -0.5, -8.0)


@pytest.mark.parametrize('hints, limits', [
    ((0.001, 0.5, 0.0), (0.02, 0.5, 0.0)), ((9.0, 0.5, 0.0), (5.0, 0.5, 0.0)),
    ((1.0, -2.0, 0.0), (1.0, -0.5, 0.0)), ((1.0, 3.0, 0.0), (1.0, 1.5, 0.0)),
    ((1.0, 0.5, -20.0), (1.0, 0.5, -8.0)), ((1.0, 0.5, 20.0), (1.0, 0.5, 8.0)),
    ((float('inf'), 0.5, 0.0), (0.02, 0.5, 0.0))])
def test_hints_count_up_to_their_limits(hints, limits):
    def logistic(quality, likeness, presence):
        odds = 1.26 * np.log(quality) + 1.53 * likeness + 0.42 * presence + 1.81
        return 1 / (1 + np.exp(-odds))

    assert trust(*hints) == pytest.approx(logistic(*limits), rel=1e-9)


def test_what_is_not_compared_is_not_what_is_compared_without_a_result():
    assert trust(0.5, 0.5, None) != trust(0.5, 0.5, 0.0)
