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

import numpy as np
import pytest

from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.presence import trust as trust_module
from lmsco_ros.core.presence.evidence import Evidence, Verdict
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.trust import trust, TrustModel
from lmsco_ros.core.types import TrackState

CONFIG = PresenceConfig(reference_frames=4, uncertain=0.5, certain=0.6, lost=0.2,
                        lost_frames=3, found=0.8, sharp=0.4, alike=0.3)
CLEAR = Evidence(10.0, presence=4.0)
GONE = Evidence(1.0, likeness=0.0, presence=-5.0)


@pytest.fixture(autouse=True)
def coefficients(monkeypatch):
    """Give the trust coefficients of its own, so that a new fit does not change what is tested."""
    monkeypatch.setattr(trust_module, 'MEASURED', TrustModel(1.26, 1.53, 0.42, 1.81))
    monkeypatch.setattr(trust_module, 'UNMEASURED', TrustModel(2.09, 2.23, 0.0, 2.47))


def judge(monitor, evidence):
    """Return the verdict on a frame."""
    return monitor.judge(monitor.assess(evidence))


def believable(monitor, evidence):
    """Return whether a frame is believed to show the target."""
    return monitor.believable(monitor.assess(evidence))


def convincing(monitor, evidence):
    """Return whether a frame would show the target anywhere."""
    return monitor.convincing(monitor.assess(evidence))


@pytest.fixture
def monitor():
    """Return a monitor whose reference is a sharpness of 10."""
    result = PresenceMonitor(CONFIG)
    for _ in range(4):
        assert judge(result, CLEAR).state is TrackState.TRACKING
    return result


def at_score(monitor, score):
    """Return evidence of a given score, by the sharpness alone."""
    low, high = 0.2, 50.0
    for _ in range(60):
        middle = (low + high) / 2
        below = monitor.assess(Evidence(middle, 0.5, 0.0)).score < score
        low, high = (middle, high) if below else (low, middle)
    return Evidence(high, 0.5, 0.0)


def test_clear_frames_keep_tracking(monitor):
    for sharpness in (9, 14, 6, 5.1):
        verdict = judge(monitor, Evidence(sharpness, presence=4.0))
        assert verdict.state is TrackState.TRACKING and verdict.believed and verdict.learns


def test_doubtful_frame_is_believed_but_not_learned_from(monitor):
    doubtful = at_score(monitor, 0.35)
    score = monitor.assess(doubtful).score
    assert judge(monitor, doubtful) == Verdict(score, TrackState.UNCERTAIN, True, False)


def test_state_does_not_flicker_between_two_thresholds(monitor):
    between = at_score(monitor, 0.55)
    assert judge(monitor, between).state is TrackState.TRACKING
    judge(monitor, at_score(monitor, 0.45))
    assert judge(monitor, between).state is TrackState.UNCERTAIN
    assert judge(monitor, at_score(monitor, 0.65)).state is TrackState.TRACKING
    assert judge(monitor, between).state is TrackState.TRACKING


def test_target_is_lost_after_enough_misses_in_a_row(monitor):
    assert not believable(monitor, GONE)
    states = [judge(monitor, GONE).state for _ in range(4)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST] * 2


def test_misses_must_be_in_a_row(monitor):
    for _ in range(5):
        assert judge(monitor, GONE).state is not TrackState.LOST
        assert judge(monitor, GONE).state is not TrackState.LOST
        assert judge(monitor, CLEAR).state is TrackState.TRACKING


@pytest.mark.parametrize('lack', [
    Evidence(10.0, 0.2, 4.0), Evidence(3.5, 1.0, 4.0), Evidence(10.0, 1.0, -0.1)],
    ids=['first filter', 'filter', 'network'])
def test_lost_target_is_found_when_all_three_agree(monitor, lack):
    for _ in range(3):
        judge(monitor, GONE)
    assert not convincing(monitor, lack) and not believable(monitor, lack)
    assert judge(monitor, lack).state is TrackState.LOST
    assert convincing(monitor, CLEAR)
    assert judge(monitor, CLEAR).state is TrackState.TRACKING


def test_after_a_cut_the_target_has_to_convince_but_with_less(monitor):
    weak = Evidence(3.5, 1.0, -0.5)
    assert believable(monitor, weak) and not convincing(monitor, weak)
    monitor.note_cut()
    # Half of what convinces otherwise does now; what was enough to go on does not.
    assert convincing(monitor, weak) and monitor.after_cut
    doubtful = at_score(monitor, 0.55)
    assert not believable(monitor, doubtful)
    assert judge(monitor, weak).state is not TrackState.LOST
    assert not monitor.after_cut and believable(monitor, doubtful)


def test_what_a_cut_excuses_is_forgotten_in_time(monitor):
    weak = Evidence(3.5, 1.0, -0.5)
    monitor.note_cut()
    for _ in range(99):
        judge(monitor, GONE)
    assert monitor.after_cut and convincing(monitor, weak)
    assert judge(monitor, GONE).state is TrackState.LOST
    assert not monitor.after_cut and not convincing(monitor, weak)
    # Who convinces as at any other time is found.
    assert judge(monitor, CLEAR).state is not TrackState.LOST


def test_without_a_network_the_filters_have_to_agree(monitor):
    for _ in range(3):
        judge(monitor, GONE)
    assert not convincing(monitor, Evidence(10.0, 0.2)) and not convincing(monitor, Evidence(3.5))
    assert judge(monitor, Evidence(9.0)).state is TrackState.TRACKING


def test_a_jump_needs_a_better_frame(monitor):
    doubtful = at_score(monitor, 0.35)
    assert believable(monitor, replace(doubtful, jump=0.9))
    assert not believable(monitor, replace(doubtful, jump=1.1))
    assert believable(monitor, replace(at_score(monitor, 0.51), jump=1.1))


def test_monitor_that_always_learns_believes_everything_and_still_judges():
    monitor = PresenceMonitor(replace(CONFIG, learn='always'))
    judge(monitor, CLEAR)
    states = []
    for _ in range(3):
        verdict = judge(monitor, GONE)
        states.append(verdict.state)
        assert verdict.believed and verdict.learns
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]


def test_reference_is_the_median_of_the_first_frames_only(monitor):
    for _ in range(50):
        judge(monitor, Evidence(100.0, presence=4.0))
    assert monitor.assess(Evidence(10.0)).quality == pytest.approx(1)
    late = PresenceMonitor(CONFIG)
    for sharpness in (8, 12, 100, 10):
        judge(late, Evidence(sharpness, presence=4.0))
    assert late.assess(Evidence(11.0)).quality == pytest.approx(1)


def test_first_frame_is_believed():
    assert believable(PresenceMonitor(CONFIG), Evidence(0.5))


@pytest.mark.parametrize('sharpness', [0.0, -3.0, float('nan'), float('inf')])
def test_frame_that_shows_nothing_is_not_believed_and_sets_no_reference(sharpness):
    monitor = PresenceMonitor(CONFIG)
    blank = Evidence(sharpness, presence=4.0)
    assert monitor.assess(blank).score == 0 and not believable(monitor, blank)
    assert judge(monitor, blank).state is not TrackState.TRACKING
    judge(monitor, Evidence(8.0))
    assert monitor.assess(Evidence(8.0)).quality == pytest.approx(1)


def test_monitors_do_not_share_what_they_saw(monitor):
    other = PresenceMonitor(CONFIG)
    judge(other, Evidence(2.0, presence=4.0))
    assert other.assess(Evidence(2.0)).quality == pytest.approx(1)
    assert monitor.assess(Evidence(10.0)).quality == pytest.approx(1)


def test_low_odds_of_a_target_followed_with_certainty_become_usual():
    """A target that the network hardly knows stays TRACKING; what falls below that does not."""
    monitor = PresenceMonitor(PresenceConfig())
    odd = Evidence(10.0, likeness=1.0, presence=0.0)
    before = monitor.assess(odd).score
    for _ in range(120):
        assert judge(monitor, odd).state is TrackState.TRACKING
    assert monitor.assess(odd).score > before
    assert monitor.assess(odd).presence == pytest.approx(4.0, abs=0.2)
    gone = Evidence(1.5, likeness=0.1, presence=-6.0)
    for _ in range(5):
        state = judge(monitor, gone).state
    assert state is TrackState.LOST
    assert monitor.assess(odd).presence == pytest.approx(4.0, abs=0.2)


def test_high_odds_are_no_measure_for_later_frames():
    monitor = PresenceMonitor(PresenceConfig())
    for _ in range(120):
        judge(monitor, Evidence(10.0, presence=8.0))
    assert monitor.assess(Evidence(10.0, presence=3.0)).presence == 3.0


HALF = Evidence(5.0, 0.5, 0.0)
# Missed even by a monitor without a reference, to which every sharpness is as usual.
NOTHING = Evidence(1.0, -0.5, -8.0)


def first_score(evidence):
    """Return the score of a frame while there is no reference."""
    return PresenceMonitor(CONFIG).assess(evidence).score


def with_thresholds(**thresholds):
    """Return a monitor without a reference; what is not given is out of reach."""
    return PresenceMonitor(replace(CONFIG, **thresholds))


def test_score_that_is_just_enough_is_enough():
    score = first_score(HALF)
    assert judge(with_thresholds(uncertain=score, certain=1.0), HALF).state is TrackState.TRACKING
    assert believable(with_thresholds(lost=score, uncertain=1.0, certain=1.0, found=1.0), HALF)
    assert convincing(with_thresholds(found=score, alike=0.5), HALF)
    monitor = with_thresholds(uncertain=score, certain=1.0)
    assert monitor.resembles(HALF)
    assert believable(monitor, replace(HALF, jump=2.0))
    above = float(np.nextafter(score, 1))
    monitor = with_thresholds(uncertain=above, certain=1.0)
    assert judge(monitor, HALF).state is TrackState.UNCERTAIN
    assert not monitor.resembles(HALF) and not believable(monitor, replace(HALF, jump=2.0))
    assert not convincing(with_thresholds(found=above), HALF)


def test_uncertain_target_is_certain_again_at_just_enough():
    monitor = with_thresholds(uncertain=0.9, certain=1.0)
    judge(monitor, Evidence(1.0, 0.0, 0.0))
    assert monitor.state is TrackState.UNCERTAIN
    monitor.config = replace(monitor.config, certain=monitor.assess(CLEAR).score)
    assert judge(monitor, CLEAR).state is TrackState.TRACKING


def test_without_a_reference_every_sharpness_is_as_usual(monitor):
    assert PresenceMonitor(CONFIG).assess(Evidence(0.1)).quality == 1
    assert monitor.assess(Evidence(2.5)).quality == 0.25
    assert monitor.assess(Evidence(1e-9)).quality == 1e-10


def test_assessment_holds_what_it_is_made_of(monitor):
    seen = monitor.assess(HALF)
    assert (seen.evidence, seen.quality, seen.presence) == (HALF, 0.5, 0.0)
    assert seen.score == trust(0.5, 0.5, 0.0)
    assert monitor.assess(replace(HALF, presence=None)).presence is None


def test_what_is_not_measured_does_not_speak_against_the_target():
    assert Evidence(10.0) == Evidence(10.0, likeness=1.0, presence=None, jump=0.0)


def test_usual_odds_follow_those_of_certain_frames_by_one_in_ten():
    monitor = PresenceMonitor(CONFIG)
    assert monitor.assess(HALF).presence == 0.0
    judge(monitor, Evidence(10.0, presence=0.0))
    # Usual are 4 - 0.1 * 4 from now on.
    assert monitor.assess(HALF).presence == pytest.approx(0.4)
    judge(monitor, Evidence(10.0, presence=1.0))
    assert monitor.assess(HALF).presence == pytest.approx(0.4 + 0.1 * 2.6)


def test_uncertain_frames_do_not_become_usual(monitor):
    doubtful = at_score(monitor, 0.35)
    before = monitor.assess(HALF).presence
    for _ in range(9):
        assert judge(monitor, doubtful).state is TrackState.UNCERTAIN
    assert monitor.assess(HALF).presence == before


def test_target_that_goes_its_own_length_does_not_jump(monitor):
    doubtful = at_score(monitor, 0.35)
    assert believable(monitor, replace(doubtful, jump=1.0))


@pytest.fixture
def cut(monitor):
    """Return a monitor after a cut, whose other thresholds are never reached."""
    monitor.config = replace(CONFIG, found=0.95, certain=1.0)
    monitor.note_cut()
    return monitor


def test_after_a_cut_half_of_sharpness_and_likeness_is_enough(cut):
    # Two tenths of the reference, 0.15 of the first filter, and log-odds of -2.
    cut.config = replace(cut.config, found=0.2)
    assert convincing(cut, Evidence(2.0, 1.0, 4.0)) and not convincing(cut, Evidence(1.99, 1.0, 4))
    assert convincing(cut, Evidence(9.0, 0.15, 4.0)) and not convincing(cut, Evidence(9, 0.149, 4))
    assert convincing(cut, Evidence(9.0, 1.0, -2.0)) and not convincing(cut, Evidence(9, 1, -2.01))


def test_otherwise_all_of_it_is_needed(monitor):
    monitor.config = replace(CONFIG, found=0.2)
    assert convincing(monitor, Evidence(4.0, 1.0, 4.0))
    assert not convincing(monitor, Evidence(3.99, 1.0, 4.0))
    assert convincing(monitor, Evidence(9.0, 0.3, 4.0))
    assert not convincing(monitor, Evidence(9.0, 0.299, 4.0))
    assert convincing(monitor, Evidence(9.0, 1.0, 0.0))
    assert not convincing(monitor, Evidence(9.0, 1.0, -0.01))


def test_after_a_cut_a_score_of_four_fifths_is_enough(cut):
    assert convincing(cut, at_score(cut, 0.801)) and not convincing(cut, at_score(cut, 0.799))
    cut.config = replace(cut.config, found=0.6, sharp=0.0)
    assert convincing(cut, at_score(cut, 0.601)) and not convincing(cut, at_score(cut, 0.599))


def test_what_looks_like_the_target_may_stand_beside_it(monitor):
    """How sharp it is in a score that the target dominates says nothing."""
    assert monitor.resembles(Evidence(0.1, 0.5, 0.0))
    assert monitor.resembles(Evidence(10.0, 0.3, 4.0))
    assert not monitor.resembles(Evidence(10.0, 0.299, 4.0))
    assert not monitor.resembles(Evidence(10.0, 0.31, -8.0))
    # A target of which the network thinks little is measured against that.
    for _ in range(200):
        judge(monitor, Evidence(10.0, presence=-4.0))
    assert monitor.resembles(Evidence(10.0, 0.31, -5.0))


def test_cut_is_over_when_the_target_is_seen(monitor):
    monitor.note_cut()
    judge(monitor, GONE)
    assert monitor.after_cut
    judge(monitor, CLEAR)
    assert not monitor.after_cut


def test_new_monitor_tracks_and_has_seen_no_cut():
    monitor = PresenceMonitor(CONFIG)
    assert monitor.state is TrackState.TRACKING and not monitor.after_cut
    states = [judge(monitor, NOTHING).state for _ in range(3)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]


def test_missed_frame_counts_from_zero_after_the_target_was_seen(monitor):
    judge(monitor, GONE)
    judge(monitor, GONE)
    judge(monitor, CLEAR)
    states = [judge(monitor, GONE).state for _ in range(3)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]


def test_lost_target_that_is_hardly_found_is_uncertain(monitor):
    for _ in range(3):
        judge(monitor, GONE)
    monitor.config = replace(CONFIG, found=0.2, sharp=0.0)
    hardly = at_score(monitor, 0.55)
    assert judge(monitor, hardly).state is TrackState.UNCERTAIN
    assert judge(monitor, replace(hardly, sharpness=2 * hardly.sharpness)).state is (
        TrackState.TRACKING)


def test_lost_target_is_still_lost_while_it_is_missed(monitor):
    for _ in range(3):
        judge(monitor, GONE)
    monitor.config = replace(CONFIG, lost_frames=100)
    assert judge(monitor, GONE).state is TrackState.LOST


def test_missed_frames_set_no_reference_and_are_not_usual():
    monitor = PresenceMonitor(CONFIG)
    judge(monitor, NOTHING)
    assert monitor.assess(Evidence(2.0)).quality == 1
    assert monitor.assess(Evidence(2.0, presence=1.0)).presence == 1.0


def test_no_sharpness_is_no_reference_even_where_nothing_is_missed():
    monitor = PresenceMonitor(replace(CONFIG, lost=0.0))
    assert judge(monitor, Evidence(0.0)).state is TrackState.UNCERTAIN
    assert monitor.assess(Evidence(8.0)).quality == 1
    judge(monitor, Evidence(0.5))
    assert monitor.assess(Evidence(1.0)).quality == 2


def test_reference_is_that_of_as_many_frames_as_asked_for(monitor):
    """Four frames of sharpness 10, which nothing changes; three leave room for another one."""
    young = PresenceMonitor(CONFIG)
    for sharpness in (10.0, 10.0, 20.0):
        judge(young, Evidence(sharpness, presence=4.0))
    judge(young, Evidence(20.0, presence=4.0))
    assert young.assess(Evidence(15.0)).quality == 1
    judge(young, Evidence(20.0, presence=4.0))
    assert young.assess(Evidence(15.0)).quality == 1
