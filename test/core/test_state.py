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

"""The motion filter against dense references, simulated motion, and what it promises."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from scipy.stats import chi2

from lmsco_ros.core import BoundingBox, TimeError
from lmsco_ros.core import state as state_module
from lmsco_ros.core.state import FrameClock, TargetState

START = BoundingBox(90, 70, 20, 10)
EXACT = np.diag([0.01, 0.01, 0.04, 0.02])
LASTING = np.diag([0.055 * 20, 0.055 * 10, 0.15 * 20, 0.15 * 10])**2

step = st.floats(0.01, 300)
number = st.floats(-30, 30)


@st.composite
def spreads(draw, count=4):
    """Return covariances of any shape."""
    root = np.array(draw(st.lists(number, min_size=count**2, max_size=count**2)))
    root = root.reshape(count, count)
    return root @ root.T + np.diag(draw(st.lists(st.floats(1e-3, 10), min_size=count,
                                                 max_size=count)))


def followed(frames=30, velocity=(1.5, -0.5), covariance=EXACT, interval=1.0):
    """Return the state of a target that moved on a line."""
    state = TargetState(START)
    for n in range(1, frames + 1):
        state.predict(interval)
        state.measure(START.moved_to((100 + n * velocity[0], 75 + n * velocity[1])), covariance)
    return state


def whole(state):
    """Return mean and covariance of all that a state knows, in its own units."""
    return state._mean, state._covariance


def transition(frames):
    """Return move and noise of the motion by brute force: the motion in many small steps."""
    parts = 4000
    dt, fading = frames / parts, 300.0
    drift = np.array([[0, 1], [0, -1 / fading]])
    move, noise = np.eye(2), np.zeros((2, 2))
    small = np.eye(2) + dt * drift + dt**2 / 2 * drift @ drift
    for _ in range(parts):
        move, noise = small @ move, small @ noise @ small.T
        noise[1, 1] += dt
    return move, noise


@pytest.mark.parametrize('frames', [1.0, 20.0, 400.0])
def test_prediction_is_that_of_many_small_steps(frames):
    state = followed()
    mean, covariance = (np.copy(part) for part in whole(state))
    area = state.box.area
    state.predict(frames)
    move, noise = transition(frames)
    for axis in (0, 1):
        both = [axis, 4 + axis]
        np.testing.assert_allclose(whole(state)[0][both], move @ mean[both], rtol=1e-3)
        np.testing.assert_allclose(
            whole(state)[1][np.ix_(both, both)],
            move @ covariance[np.ix_(both, both)] @ move.T + 6e-3**2 * area * noise, rtol=5e-3)


@given(first=step, second=step)
def test_two_steps_are_one_of_their_length(first, second):
    one, other = followed(), followed()
    one.predict(first + second)
    other.predict(first)
    other.predict(second)
    for part, same in zip(whole(one), whole(other), strict=True):
        np.testing.assert_allclose(part, same, rtol=1e-6, atol=1e-9)


@given(covariance=st.one_of(spreads(), spreads(2)), shift=st.tuples(number, number))
def test_measurement_conditions_the_dense_gaussian(covariance, shift):
    state = followed()
    state.predict(30.0)
    count = len(covariance)
    box = BoundingBox.from_center(
        tuple(c + 0.1 * s for c, s in zip(state.box.center, shift, strict=True)), (22, 9))
    mean, prior = (np.copy(part) for part in whole(state))
    state.measure(box, covariance)
    # The information form: inverse covariances add.
    units = np.diag(1 / np.array([1, 1, 22, 9])[:count])
    look = np.linalg.inv(units @ covariance @ units)
    seen = np.array([*box.center, math.log(22), math.log(9)])[:count]
    posterior = np.linalg.inv(prior)
    information = posterior @ mean
    posterior[:count, :count] += look
    information[:count] += look @ seen
    np.testing.assert_allclose(whole(state)[0], np.linalg.solve(posterior, information),
                               rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(whole(state)[1], np.linalg.inv(posterior), rtol=1e-4, atol=1e-7)


@given(steps=st.lists(st.tuples(step, st.booleans(), number, number, spreads()), max_size=12))
def test_covariance_is_symmetric_and_positive(steps):
    state = TargetState(START)
    for frames, seen, x, y, covariance in steps:
        state.predict(frames)
        if seen:
            state.measure(START.moved_to((100 + x, 75 + y)), covariance)
        told = state.covariance
        assert np.array_equal(told, told.T) and np.linalg.eigvalsh(told).min() > 0


def test_errors_that_last_are_as_large_as_the_edges_are_unsure():
    state, edges = TargetState(START), np.array([3.0, 0.5])
    state.predict(1.0)
    state.measure(START, EXACT, edges)
    lasting = np.diag([0.8 * 3.0, 0.8 * 0.5, 1.8 * 3.0, 1.8 * 0.5])**2
    np.testing.assert_allclose(state.covariance, lasting, atol=0.1)
    # Of what is not seen for a while they remain, in its sides; what measures no edges has others.
    state.predict(1e-9)
    np.testing.assert_allclose(state.covariance, lasting, atol=0.1)
    state.measure(START, EXACT)
    np.testing.assert_allclose(state.covariance, LASTING, atol=0.1)


def test_view_that_moves_carries_the_place_and_nothing_else():
    state = followed()
    box, velocity, (_, covariance) = state.box, state.velocity, whole(state)
    covariance = np.copy(covariance)
    state.carry(np.array([30.0, -4.0]))
    assert state.box.as_tuple() == pytest.approx((box.x + 30, box.y - 4, box.width, box.height))
    assert state.velocity == velocity
    np.testing.assert_array_equal(whole(state)[1], covariance)


def test_errors_that_last_are_known_after_a_jump():
    state = TargetState(START)
    state.predict(1.0)
    state.measure(START.moved_to((500, 400)), EXACT, np.array([3.0, 3.0]))
    assert state.covariance[0, 0] == pytest.approx((0.8 * 3)**2, abs=0.1)


@given(frames=st.lists(step, min_size=1, max_size=20))
def test_covariance_grows_while_nothing_is_measured(frames):
    state = followed()
    for passed in frames:
        before = state.covariance
        state.predict(passed)
        assert np.linalg.eigvalsh(state.covariance - before).min() > 0


@given(factor=st.floats(0.1, 10))
def test_other_pixels_change_the_units_alone(factor):
    """The same scene seen by a camera of another resolution."""
    plain, other = TargetState(START), TargetState(
        BoundingBox.from_center((100 * factor, 75 * factor), (20 * factor, 10 * factor)))
    for n in range(1, 15):
        for state, unit in ((plain, 1.0), (other, factor)):
            state.predict(1.0)
            if n != 9:
                state.measure(BoundingBox.from_center(
                    (unit * (100 + n + n % 3), unit * (75 - n)), (unit * 21, unit * 10)),
                    unit**2 * EXACT)
    assert other.box.as_tuple() == pytest.approx(
        [factor * side for side in plain.box.as_tuple()], rel=1e-9)
    assert other.velocity == pytest.approx([factor * v for v in plain.velocity], rel=1e-9)
    np.testing.assert_allclose(other.covariance, factor**2 * plain.covariance, rtol=1e-9)
    np.testing.assert_allclose(
        other.velocity_covariance, factor**2 * plain.velocity_covariance, rtol=1e-9)


def test_half_the_frame_rate_changes_the_velocity_per_frame_alone():
    slow = followed(velocity=(3.0, -1.0), interval=2.0)
    assert slow.velocity == pytest.approx((1.5, -0.5), rel=0.02)


def test_velocity_is_that_of_a_steady_target():
    state = followed()
    assert state.velocity == pytest.approx((1.5, -0.5), rel=0.02)
    assert state.box.center == pytest.approx((145, 60), abs=0.1)


def test_missing_target_goes_on():
    state = followed()
    state.predict(10.0)
    assert state.box.center == pytest.approx((145 + 15, 60 - 5), rel=0.02)
    state.predict(1e6)
    assert state.box.center == pytest.approx((145 + 450, 60 - 150), rel=0.02)
    assert state.box.size == pytest.approx(START.size)


def test_lasting_errors_remain_however_often_it_is_measured():
    assert np.linalg.eigvalsh(followed(300).covariance - LASTING).min() > 0
    np.testing.assert_allclose(followed(300).covariance, LASTING, atol=0.06)


def test_center_alone_says_nothing_of_the_size():
    state = TargetState(START)
    state.predict(1.0)
    before = state.covariance
    state.measure(START.scaled(1.5).moved_to((100.4, 75)), EXACT[:2, :2])
    assert state.box.size == pytest.approx(START.size)
    np.testing.assert_array_equal(state.covariance[2:, 2:], before[2:, 2:])
    assert state.covariance[0, 0] < before[0, 0]


def test_size_is_followed():
    state = TargetState(START)
    for _ in range(60):
        state.predict(1.0)
        state.measure(BoundingBox.from_center((100, 75), (30, 12)), EXACT)
    assert state.box.size == pytest.approx((30, 12), rel=0.01)


def test_jump_continues_no_motion():
    state = followed()
    state.predict(1.0)
    state.measure(START.moved_to((20, 20)), EXACT)
    assert state.box.center == pytest.approx((20, 20)) and state.velocity == (0, 0)
    np.testing.assert_allclose(state.covariance[:2, :2], EXACT[:2, :2] + LASTING[:2, :2])
    # What it does next is new: the velocity is that of the next step.
    state.predict(1.0)
    state.measure(START.moved_to((22, 21)), EXACT)
    assert state.velocity == pytest.approx((2, 1), rel=0.1)


@pytest.mark.parametrize('deviations, goes_on', [(4.9, True), (5.1, False)])
def test_motion_ends_five_deviations_from_where_it_was_expected(deviations, goes_on):
    state = followed()
    state.predict(1.0)
    x, y = state.box.center
    spread = (whole(state)[1] + np.pad(EXACT, (0, 2)))[0, 0]**0.5
    state.measure(START.moved_to((x + deviations * spread, y)), EXACT)
    assert (state.velocity != (0, 0)) is goes_on


def test_motion_goes_on_where_the_size_alone_jumps():
    state = followed()
    state.predict(1.0)
    state.measure(state.box.scaled(2.0), EXACT)
    assert state.velocity == pytest.approx((1.5, -0.5), rel=0.05)


def test_size_is_given_to_two_percent_and_grows_unsure_by_half_a_percent_in_a_frame():
    state = TargetState(START)
    for variance in (0.02**2, 0.02**2 + 16 * 0.005**2):
        np.testing.assert_allclose((state.covariance - LASTING)[2:, 2:],
                                   variance * np.diag([20**2, 10**2]), atol=1e-12)
        state.predict(16.0)


def test_after_a_cut_the_size_tells_nothing_of_the_place():
    tied = EXACT.copy()
    tied[0, 2] = tied[2, 0] = 0.01
    state = followed(covariance=tied)
    assert whole(state)[1][0, 2]
    state.forget_place((640, 480))
    for one, other in ((slice(0, 2), slice(2, 6)), (slice(4, 6), slice(0, 4))):
        assert not whole(state)[1][one, other].any() and not whole(state)[1][other, one].any()


def test_after_a_cut_the_target_may_be_anywhere_at_rest():
    state = followed()
    before = state.box
    state.forget_place((640, 480))
    assert state.box == before and state.velocity == (0, 0)
    np.testing.assert_allclose(np.diag(state.covariance)[:2],
                               [640**2 / 12 + LASTING[0, 0], 480**2 / 12 + LASTING[1, 1]])
    state.predict(1.0)
    state.measure(START.moved_to((500, 400)), EXACT)
    assert state.box.center == pytest.approx((500, 400), abs=0.01)
    assert state.velocity == pytest.approx((0, 0), abs=0.1)
    assert state.covariance[0, 0] < 2
    state.predict(1.0)
    state.measure(START.moved_to((502, 401)), EXACT)
    assert state.velocity == pytest.approx((2, 1), rel=0.1)


def simulated(rng, frames, misses):
    """Yield the squared normalized error of the position, from motion as the filter has it."""
    size, side = np.array([20.0, 20.0]), 20.0
    box = BoundingBox.from_center((300, 200), tuple(size))
    place, velocity = np.array(box.center), rng.normal(0, 0.1 * side, 2)
    lasting = rng.normal(0, 0.055 * size)
    state = TargetState(box.moved_to(tuple(place + lasting)))
    for n in range(frames):
        for _ in range(10):
            place = place + velocity / 10
            velocity = velocity * math.exp(-1 / 3000) + rng.normal(0, 6e-3 * side / 10**0.5, 2)
        state.predict(1.0)
        if n % 40 < 40 - misses:
            seen = place + lasting + rng.normal(0, 0.3, 2)
            state.measure(box.moved_to(tuple(seen)), 0.3**2 * np.eye(2))
        if n % 40 == 39:
            error = np.array(state.box.center) - place
            yield error @ np.linalg.solve(state.covariance[:2, :2], error)


@pytest.mark.parametrize('misses', [0, 3, 20])
def test_errors_are_as_large_as_they_are_told_to_be(misses):
    """The mean of normalized squared errors of 200 runs is within the band of chi-square."""
    rng = np.random.default_rng(5)
    errors = [list(simulated(rng, 40, misses)) for _ in range(200)]
    low, high = chi2.ppf([0.005, 0.995], 2 * 200) / 200
    assert low < np.mean(errors) < high


def test_process_noise_is_seen_by_the_consistency_test(monkeypatch):
    monkeypatch.setattr(state_module, '_MANEUVER', 2e-3)
    rng = np.random.default_rng(5)
    errors = [list(simulated(rng, 40, 20)) for _ in range(200)]
    assert np.mean(errors) > chi2.ppf(0.995, 2 * 200) / 200


def test_frames_without_times_are_one_step_each():
    clock = FrameClock()
    assert [clock.step(None) for _ in range(3)] == [1.0] * 3 and clock.rate == 1.0


def test_times_are_steps_of_a_camera_of_30_frames_a_second():
    clock = FrameClock(1.7e9)
    assert clock.step(1.7e9 + 0.1) == pytest.approx(3.0, rel=1e-5)
    assert clock.step(1.7e9 + 0.2) == pytest.approx(3.0, rel=1e-5)
    assert clock.rate == 30.0


def test_frames_of_a_faster_camera_are_parts_of_a_step():
    assert FrameClock(1.0).step(1.0 + 1 / 64) == 30 / 64


def test_time_that_does_not_go_on_is_one_frame():
    clock = FrameClock(10.0)
    assert [clock.step(time) for time in (10.0, 3.0, 4.0)] == [1.0, 1.0, 30.0]


@pytest.mark.parametrize('time', [math.nan, math.inf, 10**400, '0.5', True, 1j, object()])
def test_time_that_is_no_number_is_refused(time):
    clock = FrameClock(1.0)
    for take in (clock.step, FrameClock):
        with pytest.raises(TimeError, match='expected a finite number of seconds'):
            take(time)
    assert clock.step(2.0) == pytest.approx(30.0)


@pytest.mark.parametrize('first, second', [(None, 1.0), (1.0, None)])
def test_times_are_given_for_every_frame_or_for_none(first, second):
    clock = FrameClock(first)
    with pytest.raises(TimeError, match='give the time of every frame, or of none'):
        clock.step(second)
    assert clock.step(None if first is None else 1.5) == (1.0 if first is None else 15.0)


@given(whole_seconds=st.integers(0, 2**31), numeric=st.sampled_from([int, float, np.float64,
                                                                     np.int64]))
def test_any_real_number_is_a_time(whole_seconds, numeric):
    clock = FrameClock(numeric(whole_seconds))
    assert clock.step(numeric(whole_seconds + 1)) == 30.0


def test_velocity_is_as_sure_as_what_was_seen():
    blurred = followed(20, covariance=100 * EXACT)
    told = [np.linalg.eigvalsh(state.velocity_covariance)
            for state in (followed(20), blurred, TargetState(START))]
    assert 0 < told[0].min() and (told[0] < told[1]).all() and (told[1] < told[2]).all()
    # Handed out: nobody can change the state by it.
    blurred.velocity_covariance[...] = 0
    assert blurred.velocity_covariance.any()
