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
from lmsco_ros.core.types import TrackState

CONFIG = ConfidenceConfig(reference_frames=4, uncertain=0.5, lost=0.2, lost_frames=3, found=0.6,
                          absent=0.2, present=0.6, tiles=4)


@pytest.fixture
def monitor():
    """Return a monitor whose reference is a sharpness of 10."""
    result = ConfidenceMonitor(CONFIG)
    for _ in range(4):
        assert result.judge(Evidence(10.0)) is TrackState.TRACKING
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


def test_sharp_frames_keep_tracking(monitor):
    for sharpness in (9, 14, 6, 5.1):
        assert monitor.believable(Evidence(sharpness))
        assert monitor.judge(Evidence(sharpness)) is TrackState.TRACKING


def test_dull_frame_is_uncertain_but_believed(monitor):
    assert monitor.believable(Evidence(4))
    assert monitor.judge(Evidence(4)) is TrackState.UNCERTAIN
    assert monitor.judge(Evidence(8)) is TrackState.TRACKING


def test_target_is_lost_after_enough_misses_in_a_row(monitor):
    assert not monitor.believable(Evidence(1))
    states = [monitor.judge(Evidence(1)) for _ in range(4)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST] * 2


def test_misses_must_be_in_a_row(monitor):
    for _ in range(5):
        assert monitor.judge(Evidence(1)) is not TrackState.LOST
        assert monitor.judge(Evidence(1)) is not TrackState.LOST
        assert monitor.judge(Evidence(9)) is TrackState.TRACKING


def test_lost_target_needs_a_clear_frame_to_be_found(monitor):
    for _ in range(3):
        monitor.judge(Evidence(1))
    assert monitor.state is TrackState.LOST
    assert not monitor.believable(Evidence(5.5))
    assert monitor.judge(Evidence(5.5)) is TrackState.LOST
    assert monitor.believable(Evidence(6.5))
    assert monitor.judge(Evidence(6.5)) is TrackState.TRACKING
    assert monitor.state is TrackState.TRACKING


def test_reference_is_the_median_of_the_first_frames_only(monitor):
    for _ in range(50):
        monitor.judge(Evidence(100))
    assert monitor.quality(10) == pytest.approx(1)
    late = ConfidenceMonitor(CONFIG)
    for sharpness in (8, 12, 100, 10):
        late.judge(Evidence(sharpness))
    assert late.quality(11) == pytest.approx(1)


def test_first_frame_is_believed():
    assert ConfidenceMonitor(CONFIG).believable(Evidence(0.5))


def test_score_is_a_trust_between_zero_and_one(monitor):
    scores = [monitor.score(Evidence(sharpness)) for sharpness in (-3, 0, 1, 5, 10, 20, 100)]
    assert scores == sorted(scores)
    assert all(0 <= score <= 1 for score in scores)
    assert scores[1] == 0 and scores[4] > 0.5


def test_monitors_do_not_share_what_they_saw(monitor):
    other = ConfidenceMonitor(CONFIG)
    other.judge(Evidence(2.0))
    assert other.quality(2.0) == pytest.approx(1)
    assert monitor.quality(10.0) == pytest.approx(1)


@pytest.mark.parametrize('sharpness, presence, state, believed', [
    (10, 0.9, TrackState.TRACKING, True), (10, 0.5, TrackState.UNCERTAIN, True),
    (4, 0.9, TrackState.UNCERTAIN, True), (10, 0.1, TrackState.UNCERTAIN, False),
    (1, 0.9, TrackState.UNCERTAIN, False)])
def test_frame_must_be_sharp_and_show_the_target(monitor, sharpness, presence, state, believed):
    evidence = Evidence(sharpness, presence)
    assert monitor.believable(evidence) == believed
    assert monitor.judge(evidence) is state


@pytest.mark.parametrize('evidence', [Evidence(10, 0.1), Evidence(1, 0.9)])
def test_either_lack_loses_the_target_and_both_must_be_there_to_find_it(monitor, evidence):
    assert [monitor.judge(evidence) for _ in range(3)][-1] is TrackState.LOST
    for unclear in (Evidence(10, 0.5), Evidence(5.5, 0.9)):
        assert not monitor.convincing(unclear)
        assert monitor.judge(unclear) is TrackState.LOST
    assert monitor.judge(Evidence(6.5, 0.7)) is TrackState.TRACKING


def test_trust_falls_with_the_presence(monitor):
    scores = [monitor.score(Evidence(10, presence)) for presence in (0, 0.3, 1)]
    assert scores[0] == 0 and scores[1] == pytest.approx(0.3 * scores[2])


@pytest.mark.parametrize('lost', [0.2, 0.0])
def test_frames_that_show_nothing_set_no_reference(lost):
    monitor = ConfidenceMonitor(replace(CONFIG, lost=lost))
    blank = Evidence(0.0)
    assert monitor.judge(blank) is not TrackState.TRACKING or lost == 0
    assert monitor.believable(blank) == (lost == 0) and monitor.score(blank) == 0
    monitor.judge(Evidence(8.0))
    assert monitor.quality(8.0) == pytest.approx(1)
