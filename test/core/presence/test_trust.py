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

from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.presence.evidence import Evidence
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.trust import MEASURED, trust, UNMEASURED
from lmsco_ros.core.types import TrackState


@given(quality=st.floats(0.01, 6), likeness=st.floats(-1, 2), more=st.floats(0, 2),
       presence=st.one_of(st.none(), st.floats(-20, 20)))
def test_trust_is_a_probability_that_grows_with_each_hint(quality, likeness, more, presence):
    one = trust(quality, likeness, presence)
    assert 0 < one < 1
    assert trust(quality + more, likeness, presence) >= one
    assert trust(quality, likeness + more, presence) >= one
    if presence is not None:
        assert trust(quality, likeness, presence + more) >= one


def logistic(model, quality, likeness, presence=0.0):
    """Return the probability that a model gives hints within their limits."""
    odds = (model.quality * np.log(quality) + model.likeness * likeness
            + model.presence * presence + model.constant)
    return 1 / (1 + np.exp(-odds))


def test_trust_is_the_logistic_function_of_the_weighted_hints():
    assert trust(0.5, 0.8, 1.5) == pytest.approx(logistic(MEASURED, 0.5, 0.8, 1.5))
    assert trust(0.5, 0.8, None) == pytest.approx(logistic(UNMEASURED, 0.5, 0.8))


def test_every_hint_counts_that_there_is():
    """However the coefficients were fitted."""
    assert min(MEASURED.quality, MEASURED.likeness, MEASURED.presence) > 0.1
    assert min(UNMEASURED.quality, UNMEASURED.likeness) > 0.1 and UNMEASURED.presence == 0


@pytest.mark.parametrize(('there', 'gone'), [(4.0, -5.0), (None, None)],
                         ids=['measured', 'unmeasured'])
def test_target_as_in_the_first_frame_is_trusted_and_nothing_of_it_is_not(there, gone):
    limits = PresenceConfig()
    assert trust(1.0, 1.0, there) > limits.found
    assert trust(0.1, 0.0, gone) < limits.lost


def test_values_that_are_no_numbers_speak_against_the_target():
    assert trust(1.0, float('nan'), float('nan')) == trust(1.0, -0.5, -8.0)


@pytest.mark.parametrize('hints, limits', [
    ((0.001, 0.5, 0.0), (0.02, 0.5, 0.0)), ((9.0, 0.5, 0.0), (5.0, 0.5, 0.0)),
    ((1.0, -2.0, 0.0), (1.0, -0.5, 0.0)), ((1.0, 3.0, 0.0), (1.0, 1.5, 0.0)),
    ((1.0, 0.5, -20.0), (1.0, 0.5, -8.0)), ((1.0, 0.5, 20.0), (1.0, 0.5, 8.0)),
    ((float('inf'), 0.5, 0.0), (0.02, 0.5, 0.0))])
def test_hints_count_up_to_their_limits(hints, limits):
    assert trust(*hints) == pytest.approx(logistic(MEASURED, *limits), rel=1e-9)


def test_what_is_not_measured_is_not_what_is_measured_without_a_result():
    assert trust(0.5, 0.5, None) != trust(0.5, 0.5, 0.0)


@pytest.fixture
def monitor():
    """Return a monitor as it comes, with the coefficients that were fitted."""
    return PresenceMonitor(PresenceConfig())


def state_after(monitor, evidence, frames=1):
    """Return the state after some frames that look all the same."""
    for _ in range(frames):
        state = monitor.judge(monitor.assess(evidence)).state
    return state


@pytest.mark.parametrize(('there', 'gone'), [(4.0, -5.0), (None, None)],
                         ids=['measured', 'unmeasured'])
def test_thresholds_suit_what_was_fitted(monitor, there, gone):
    clear, nothing = Evidence(10.0, 1.0, there), Evidence(1.0, 0.0, gone)
    assert state_after(monitor, clear, 20) is TrackState.TRACKING
    assert state_after(monitor, nothing) is TrackState.UNCERTAIN
    assert state_after(monitor, nothing, PresenceConfig().lost_frames) is TrackState.LOST
    assert state_after(monitor, clear) is TrackState.TRACKING


def test_target_that_the_network_hardly_knows_is_known_within_a_second(monitor):
    """It is just certain at first; what is usual of it counts as much as of any other later."""
    just = (PresenceConfig().uncertain + 1) / 2
    odds = (np.log(just / (1 - just)) - MEASURED.constant - MEASURED.likeness) / MEASURED.presence
    hardly = Evidence(10.0, 1.0, float(odds))
    assert monitor.assess(hardly).score == pytest.approx(just) and odds < 3
    assert state_after(monitor, hardly, 25) is TrackState.TRACKING
    # All but a tenth of what its odds lack is made up for.
    assert monitor.assess(hardly).presence == pytest.approx(4.0, abs=0.1 * (4 - odds))
    assert monitor.assess(hardly).score > PresenceConfig().found
