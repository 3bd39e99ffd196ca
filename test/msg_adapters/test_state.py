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

"""States survive the way through odometry, and say nothing of what nobody knows."""

from geometry_msgs.msg import Quaternion
from hypothesis import given, strategies as st
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from std_msgs.msg import Header

from msg_adapters.errors import StateMessageError
from msg_adapters.state import odometry_from_state, State, state_from_odometry, UNKNOWN

NUMBERS = st.floats(-1e5, 1e5)
PAIRS = st.tuples(NUMBERS, NUMBERS)
SPREADS = st.tuples(st.floats(0, 1e6), st.floats(0, 1e6), st.floats(-1, 1)).map(
    lambda of: np.array([[of[0], of[2]], [of[2], of[1]]]))
STATES = st.builds(State, st.integers(0, 2**32 - 1), PAIRS, SPREADS, PAIRS, SPREADS)
STATE = State(7, (12.5, 30.0), np.array([[4.0, 1.0], [1.0, 9.0]]), (60.0, -3.0),
              np.array([[16.0, -2.0], [-2.0, 25.0]]))


@given(STATES)
def test_state_round_trip(state):
    back = state_from_odometry(odometry_from_state(state))
    assert (back.track_id, back.center, back.velocity) == (
        state.track_id, state.center, state.velocity)
    np.testing.assert_array_equal(back.covariance, state.covariance)
    np.testing.assert_array_equal(back.velocity_covariance, state.velocity_covariance)


def test_largest_number_of_a_target_survives():
    largest = State(**vars(STATE) | {'track_id': 2**32 - 1})
    assert state_from_odometry(odometry_from_state(largest)).track_id == 2**32 - 1


def test_state_does_not_change_with_its_message():
    message = odometry_from_state(STATE)
    state = state_from_odometry(message)
    message.pose.covariance[:] = 0.0
    message.twist.covariance[:] = 0.0
    np.testing.assert_array_equal(state.covariance, STATE.covariance)
    np.testing.assert_array_equal(state.velocity_covariance, STATE.velocity_covariance)


def test_every_number_is_in_its_place():
    message = odometry_from_state(STATE, Header(frame_id='thermal'))
    assert (message.header.frame_id, message.child_frame_id) == ('thermal', 'target_7')
    place, speed = message.pose.pose.position, message.twist.twist.linear
    assert (place.x, place.y, place.z) == (12.5, 30.0, 0.0)
    assert (speed.x, speed.y, speed.z) == (60.0, -3.0, 0.0)
    assert message.pose.pose.orientation == Quaternion(w=1.0)
    pose, twist = (np.reshape(part.covariance, (6, 6)) for part in (message.pose, message.twist))
    np.testing.assert_array_equal(pose[:2, :2], STATE.covariance)
    np.testing.assert_array_equal(twist[:2, :2], STATE.velocity_covariance)
    for whole in (pose, twist):
        np.testing.assert_array_equal(whole[2:, 2:], UNKNOWN * np.eye(4))
        assert not whole[:2, 2:].any() and not whole[2:, :2].any()


@pytest.mark.parametrize('wrong', [float('nan'), float('inf')])
@pytest.mark.parametrize('place', ['center', 'covariance', 'velocity', 'velocity_covariance'])
def test_numbers_that_are_not_finite_are_refused(place, wrong):
    values = vars(STATE) | {place: (wrong, 0.0) if place in ('center', 'velocity')
                            else np.array([[1.0, wrong], [wrong, 1.0]])}
    with pytest.raises(StateMessageError, match='target 7 has a number that is not finite'):
        odometry_from_state(State(**values))


@pytest.mark.parametrize('wrong', [float('nan'), float('inf')])
@pytest.mark.parametrize('spoil', [
    lambda message, wrong: setattr(message.pose.pose.position, 'y', wrong),
    lambda message, wrong: setattr(message.twist.twist.linear, 'x', wrong),
    lambda message, wrong: message.pose.covariance.__setitem__(1, wrong),
    lambda message, wrong: message.twist.covariance.__setitem__(7, wrong)],
    ids=['center', 'velocity', 'covariance', 'velocity_covariance'])
def test_odometry_with_numbers_that_are_not_finite_is_refused(spoil, wrong):
    message = odometry_from_state(STATE)
    spoil(message, wrong)
    with pytest.raises(StateMessageError, match='target 7 has a number that is not finite'):
        state_from_odometry(message)


@pytest.mark.parametrize('frame', [
    '', 'target_', 'target_x', 'base_link', '7', 'target_²', 'target_' + '9' * 5000])
def test_odometry_of_something_else_is_refused(frame):
    with pytest.raises(StateMessageError, match='not that of a target; expected target_1') as told:
        state_from_odometry(Odometry(child_frame_id=frame))
    assert len(str(told.value)) < 200
