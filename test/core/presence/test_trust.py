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

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.presence.evidence import Evidence
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.trust import log_odds, MEASURED, trust, UNMEASURED
from lmsco_ros.core.types import TrackState


@given(quality=st.floats(0.01, 6), likeness=st.floats(-1, 2), more=st.floats(0, 2),
       measured=st.one_of(st.none(), st.tuples(st.floats(-20, 20), st.floats(0.01, 1))))
def test_trust_is_a_probability_that_grows_with_each_hint(quality, likeness, more, measured):
    presence, vagueness = measured or (None, None)
    one = trust(quality, likeness, presence, vagueness)
    assert 0 < one < 1
    assert trust(quality + more, likeness, presence, vagueness) >= one
    assert trust(quality, likeness + more, presence, vagueness) >= one
    if measured is not None:
        assert trust(quality, likeness, presence + more, vagueness) >= one
        assert trust(quality, likeness, presence, vagueness + more) <= one


def logistic(model, quality, likeness, presence=0.0, vagueness=1.0):
    """Return the probability that a model gives hints within their limits."""
    odds = (model.quality * np.log(quality) + model.likeness * likeness
            + model.presence * presence + model.vagueness * np.log(vagueness) + model.constant)
    return 1 / (1 + np.exp(-odds))


def test_trust_is_the_logistic_function_of_the_weighted_hints():
    assert trust(0.5, 0.8, 1.5, 0.1) == pytest.approx(logistic(MEASURED, 0.5, 0.8, 1.5, 0.1))
    assert trust(0.5, 0.8) == pytest.approx(logistic(UNMEASURED, 0.5, 0.8))


def test_every_hint_counts_that_there_is():
    """However the coefficients were fitted."""
    assert min(MEASURED.quality, MEASURED.likeness, MEASURED.presence) > 0.1
    assert MEASURED.vagueness < -0.5
    assert min(UNMEASURED.quality, UNMEASURED.likeness) > 0.1
    assert UNMEASURED.presence == UNMEASURED.vagueness == 0


@pytest.mark.parametrize(('there', 'gone'), [((4.0, 0.06), (-5.0, 0.2)), ((), ())],
                         ids=['measured', 'unmeasured'])
def test_target_as_in_the_first_frame_is_trusted_and_nothing_of_it_is_not(there, gone):
    limits = PresenceConfig()
    assert trust(1.0, 1.0, *there) > limits.found
    assert trust(0.1, 0.0, *gone) < limits.lost


def test_values_that_are_no_numbers_speak_against_the_target():
    nan = float('nan')
    assert trust(1.0, nan, nan, nan) == trust(1.0, -0.5, -8.0, 0.5)


@pytest.mark.parametrize('hints, limits', [
    ((0.001, 0.5, 0.0, 0.1), (0.02, 0.5, 0.0, 0.1)), ((9.0, 0.5, 0.0, 0.1), (5.0, 0.5, 0.0, 0.1)),
    ((1.0, -2.0, 0.0, 0.1), (1.0, -0.5, 0.0, 0.1)), ((1.0, 3.0, 0.0, 0.1), (1.0, 1.5, 0.0, 0.1)),
    ((1.0, 0.5, -20.0, 0.1), (1.0, 0.5, -8.0, 0.1)),
    ((1.0, 0.5, 20.0, 0.1), (1.0, 0.5, 8.0, 0.1)),
    ((1.0, 0.5, 0.0, 0.01), (1.0, 0.5, 0.0, 0.03)), ((1.0, 0.5, 0.0, 2.0), (1.0, 0.5, 0.0, 0.5)),
    ((float('inf'), 0.5, 0.0, 0.1), (0.02, 0.5, 0.0, 0.1))])
def test_hints_count_up_to_their_limits(hints, limits):
    assert trust(*hints) == pytest.approx(logistic(MEASURED, *limits), rel=1e-9)


def test_what_is_not_measured_is_not_what_is_measured_without_a_result():
    assert trust(0.5, 0.5) != trust(0.5, 0.5, 0.0, 0.5)


@pytest.fixture
def monitor():
    """Return a monitor as it comes, with the coefficients that were fitted."""
    return PresenceMonitor(PresenceConfig())


def state_after(monitor, evidence, frames=1):
    """Return the state after some frames that look all the same."""
    for _ in range(frames):
        state = monitor.judge(monitor.assess(evidence)).state
    return state


@pytest.mark.parametrize(('there', 'gone'), [((4.0, 0.06), (-5.0, 0.2)), ((), ())],
                         ids=['measured', 'unmeasured'])
def test_thresholds_suit_what_was_fitted(monitor, there, gone):
    clear, nothing = Evidence(10.0, 1.0, *there), Evidence(1.0, 0.0, *gone)
    assert monitor.start(clear).state is TrackState.TRACKING
    assert state_after(monitor, clear, 20) is TrackState.TRACKING
    assert state_after(monitor, nothing) is TrackState.UNCERTAIN
    assert state_after(monitor, nothing, PresenceConfig().lost_frames) is TrackState.LOST
    assert state_after(monitor, clear, 7) is TrackState.TRACKING


def test_target_that_the_network_does_not_know_is_tracked_by_its_edges(monitor):
    """Odds of 0 from the start on, but edges as sure as of any other target."""
    unknown = Evidence(10.0, 1.0, 0.0, 0.06)
    assert monitor.start(unknown).state is TrackState.TRACKING
    assert state_after(monitor, unknown, 30) is TrackState.TRACKING


def test_start_where_nothing_has_edges_is_no_start_on_a_target(monitor):
    """Sharp and alike as only what is seen a moment after it was learned."""
    ground = Evidence(10.0, 1.0, 1.0, 0.19)
    assert monitor.start(ground).state is TrackState.UNCERTAIN
    assert monitor.assess(ground).score < 0.5
    assert state_after(monitor, ground, 30) is not TrackState.TRACKING


def test_noise_that_is_new_in_each_frame_is_lost_at_once(monitor):
    noise = Evidence(6.0, 1.0, 1.0, 0.17)
    monitor.start(noise)
    later = Evidence(4.0, 0.2, -2.0, 0.18)
    assert state_after(monitor, later, PresenceConfig().lost_frames) is TrackState.LOST


@pytest.mark.parametrize('probability, odds', [
    (0.5, 0.0), (0.8, math.log(4)), (0.2, -math.log(4)), (1e-3, -math.log(999))])
def test_log_odds_are_those_of_a_probability(probability, odds):
    assert log_odds(probability) == pytest.approx(odds, abs=1e-12)


@pytest.mark.parametrize('probability', [0.0, 1.0])
def test_log_odds_of_certainty_are_finite(probability):
    assert 9 < abs(log_odds(probability)) < 10
    assert (log_odds(probability) > 0) == (probability > 0.5)
