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

"""Stamps always go forward, and say what the container said."""

from fractions import Fraction

from hypothesis import given, strategies
import pytest

from lmsco_ros.media.timeline import Timeline

TIMES = strategies.lists(strategies.none() | strategies.fractions(-100, 100), max_size=30)


def stamps(times, fps=25):
    timeline = Timeline(Fraction(fps))
    return [timeline.stamp(None if time is None else Fraction(time)) for time in times], timeline


@given(TIMES)
def test_any_times_give_stamps_that_go_forward_from_zero(times):
    result, _ = stamps(times)
    assert result[:1] in ([], [0])
    assert all(before < after for before, after in zip(result, result[1:]))


@given(strategies.lists(strategies.integers(-10**6, 10**6), min_size=1, unique=True))
def test_times_that_go_forward_are_kept(milliseconds):
    times = sorted(milliseconds)
    result, timeline = stamps([Fraction(time, 1000) for time in times])
    assert result == [(time - times[0]) * 1_000_000 for time in times]
    assert not timeline.missing and not timeline.repeated and not timeline.restarts


def test_without_times_the_rate_counts_exactly():
    result, timeline = stamps([None] * 3001, Fraction(30000, 1001))
    assert result[3000] == 100_100_000_000 and timeline.missing == 3001


@pytest.mark.parametrize('times, expected', [
    ([0, None, 2], [0, 40, 2000]), ([None, 5, 6], [0, 40, 1040]),
    ([0, 2, 1, 3], [0, 2000, 2040, 4040])])
def test_gaps_and_new_beginnings(times, expected):
    assert stamps(times)[0] == [1_000_000 * value for value in expected]


def test_a_repeated_time_does_not_move_the_next_one():
    result, timeline = stamps([0, 0, 0, Fraction(1, 25)])
    assert result == [0, 1, 2, 40_000_000] and timeline.repeated == 2
