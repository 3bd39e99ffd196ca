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

"""Sharpness of scores, and the decisions that follow from it."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.confidence import ConfidenceMonitor, Evidence, peak_to_sidelobe_ratio
from lmsco_ros.core.config import ConfidenceConfig
from lmsco_ros.core.trust import trust
from lmsco_ros.core.types import TrackState

CONFIG = ConfidenceConfig(reference_frames=4, uncertain=0.5, certain=0.6, lost=0.2,
                          lost_frames=3, found=0.8, sharp=0.4, alike=0.3)
CLEAR = Evidence(10.0, presence=4.0)
GONE = Evidence(1.0, likeness=0.0, presence=-5.0)


@pytest.fixture
def monitor():
    """Return a monitor whose reference is a sharpness of 10."""
    result = ConfidenceMonitor(CONFIG)
    for _ in range(4):
        assert result.judge(CLEAR) is TrackState.TRACKING
    return result


def slow_ratio(grid, exclude):
    """Return the peak-to-sidelobe ratio point by point."""
    size = grid.shape[0]
    row, column = np.unravel_index(np.argmax(grid), grid.shape)
    rest = []
    for i, j in np.ndindex(grid.shape):
        distance = max(min((i - row) % size, (row - i) % size),
                       min((j - column) % size, (column - j) % size))
        if distance > exclude:
            rest.append(grid[i, j])
    return (grid[row, column] - np.mean(rest)) / np.std(rest)


@given(seed=st.integers(0, 2**32 - 1), size=st.integers(7, 15), exclude=st.integers(0, 2))
def test_ratio_is_that_of_the_loop(seed, size, exclude):
    grid = np.random.default_rng(seed).normal(size=(size, size))
    assert peak_to_sidelobe_ratio(grid, exclude) == pytest.approx(slow_ratio(grid, exclude))


@given(seed=st.integers(0, 2**32 - 1), gain=st.floats(0.1, 10), offset=st.floats(-5, 5),
       move=st.tuples(st.integers(0, 12), st.integers(0, 12)))
def test_ratio_knows_neither_gain_nor_offset_nor_place(seed, gain, offset, move):
    grid = np.random.default_rng(seed).normal(size=(13, 13))
    other = gain * np.roll(grid, move, axis=(0, 1)) + offset
    assert peak_to_sidelobe_ratio(other, 2) == pytest.approx(peak_to_sidelobe_ratio(grid, 2))


def test_sharp_peak_over_noise_beats_noise(rng):
    noise = rng.normal(size=(31, 31))
    peak = noise.copy()
    peak[5, 30] += 20
    assert peak_to_sidelobe_ratio(peak, 2) > 3 * peak_to_sidelobe_ratio(noise, 2)


def test_flat_scores_are_not_sharp():
    assert peak_to_sidelobe_ratio(np.zeros((9, 9)), 1) == 0
    assert peak_to_sidelobe_ratio(np.full((9, 9), 3.3, np.float32), 1) < 1


def at_score(monitor, score):
    """Return evidence of a given score, by the sharpness alone."""
    low, high = 0.2, 50.0
    for _ in range(60):
        middle = (low + high) / 2
        below = monitor.score(Evidence(middle, 0.5, 0.0)) < score
        low, high = (middle, high) if below else (low, middle)
    return Evidence(high, 0.5, 0.0)


def test_clear_frames_keep_tracking(monitor):
    for sharpness in (9, 14, 6, 5.1):
        evidence = Evidence(sharpness, presence=4.0)
        assert monitor.believable(evidence)
        assert monitor.judge(evidence) is TrackState.TRACKING and monitor.learns


def test_doubtful_frame_is_believed_but_not_learned_from(monitor):
    doubtful = at_score(monitor, 0.35)
    assert monitor.believable(doubtful)
    assert monitor.judge(doubtful) is TrackState.UNCERTAIN and not monitor.learns


def test_state_does_not_flicker_between_two_thresholds(monitor):
    between = at_score(monitor, 0.55)
    assert monitor.judge(between) is TrackState.TRACKING
    monitor.judge(at_score(monitor, 0.45))
    assert monitor.judge(between) is TrackState.UNCERTAIN
    assert monitor.judge(at_score(monitor, 0.65)) is TrackState.TRACKING
    assert monitor.judge(between) is TrackState.TRACKING


def test_target_is_lost_after_enough_misses_in_a_row(monitor):
    assert not monitor.believable(GONE)
    states = [monitor.judge(GONE) for _ in range(4)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST] * 2


def test_misses_must_be_in_a_row(monitor):
    for _ in range(5):
        assert monitor.judge(GONE) is not TrackState.LOST
        assert monitor.judge(GONE) is not TrackState.LOST
        assert monitor.judge(CLEAR) is TrackState.TRACKING


@pytest.mark.parametrize('lack', [
    Evidence(10.0, 0.2, 4.0), Evidence(3.5, 1.0, 4.0), Evidence(10.0, 1.0, -0.1)],
    ids=['first filter', 'filter', 'comparison'])
def test_lost_target_is_found_when_all_three_agree(monitor, lack):
    for _ in range(3):
        monitor.judge(GONE)
    assert not monitor.convincing(lack) and not monitor.believable(lack)
    assert monitor.judge(lack) is TrackState.LOST
    assert monitor.convincing(CLEAR)
    assert monitor.judge(CLEAR) is TrackState.TRACKING


def test_after_a_cut_the_target_has_to_convince_but_with_less(monitor):
    weak = Evidence(3.5, 1.0, -0.5)
    assert monitor.believable(weak) and not monitor.convincing(weak)
    monitor.cut()
    # Half of what convinces otherwise does now; what was enough to go on does not.
    assert monitor.convincing(weak) and monitor.after_cut
    doubtful = at_score(monitor, 0.55)
    assert not monitor.believable(doubtful)
    assert monitor.judge(weak) is not TrackState.LOST
    assert not monitor.after_cut and monitor.believable(doubtful)


def test_what_a_cut_excuses_is_forgotten_in_time(monitor):
    weak = Evidence(3.5, 1.0, -0.5)
    monitor.cut()
    for _ in range(99):
        monitor.judge(GONE)
    assert monitor.after_cut and monitor.convincing(weak)
    assert monitor.judge(GONE) is TrackState.LOST
    assert not monitor.after_cut and not monitor.convincing(weak)
    # Who convinces as at any other time is found.
    assert monitor.judge(CLEAR) is not TrackState.LOST


def test_without_a_network_the_filters_have_to_agree(monitor):
    for _ in range(3):
        monitor.judge(GONE)
    assert not monitor.convincing(Evidence(10.0, 0.2)) and not monitor.convincing(Evidence(3.5))
    assert monitor.judge(Evidence(9.0)) is TrackState.TRACKING


def test_a_jump_needs_a_better_frame(monitor):
    doubtful = at_score(monitor, 0.35)
    assert monitor.believable(replace(doubtful, jump=0.9))
    assert not monitor.believable(replace(doubtful, jump=1.1))
    assert monitor.believable(replace(at_score(monitor, 0.51), jump=1.1))


def test_monitor_that_always_learns_believes_everything_and_still_judges():
    monitor = ConfidenceMonitor(replace(CONFIG, learn='always'))
    monitor.judge(CLEAR)
    states = []
    for _ in range(3):
        assert monitor.believable(GONE)
        states.append(monitor.judge(GONE))
        assert monitor.learns
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]


def test_reference_is_the_median_of_the_first_frames_only(monitor):
    for _ in range(50):
        monitor.judge(Evidence(100.0, presence=4.0))
    assert monitor.quality(10) == pytest.approx(1)
    late = ConfidenceMonitor(CONFIG)
    for sharpness in (8, 12, 100, 10):
        late.judge(Evidence(sharpness, presence=4.0))
    assert late.quality(11) == pytest.approx(1)


def test_first_frame_is_believed():
    assert ConfidenceMonitor(CONFIG).believable(Evidence(0.5))


@pytest.mark.parametrize('sharpness', [0.0, -3.0, float('nan'), float('inf')])
def test_frame_that_shows_nothing_is_not_believed_and_sets_no_reference(sharpness):
    monitor = ConfidenceMonitor(CONFIG)
    blank = Evidence(sharpness, presence=4.0)
    assert monitor.score(blank) == 0 and not monitor.believable(blank)
    assert monitor.judge(blank) is not TrackState.TRACKING
    monitor.judge(Evidence(8.0))
    assert monitor.quality(8.0) == pytest.approx(1)


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


def test_monitors_do_not_share_what_they_saw(monitor):
    other = ConfidenceMonitor(CONFIG)
    other.judge(Evidence(2.0, presence=4.0))
    assert other.quality(2.0) == pytest.approx(1)
    assert monitor.quality(10.0) == pytest.approx(1)


def test_low_odds_of_a_target_followed_with_certainty_become_usual():
    """A target that the network hardly knows stays TRACKING; what falls below that does not."""
    monitor = ConfidenceMonitor(ConfidenceConfig())
    odd = Evidence(10.0, likeness=1.0, presence=0.0)
    before = monitor.score(odd)
    for _ in range(120):
        assert monitor.judge(odd) is TrackState.TRACKING
    assert monitor.score(odd) > before
    assert monitor.presence(odd) == pytest.approx(4.0, abs=0.2)
    gone = Evidence(1.5, likeness=0.1, presence=-6.0)
    for _ in range(5):
        state = monitor.judge(gone)
    assert state is TrackState.LOST
    assert monitor.presence(odd) == pytest.approx(4.0, abs=0.2)


def test_high_odds_are_no_measure_for_later_frames():
    monitor = ConfidenceMonitor(ConfidenceConfig())
    for _ in range(120):
        monitor.judge(Evidence(10.0, presence=8.0))
    assert monitor.presence(Evidence(10.0, presence=3.0)) == 3.0
