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
import math

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
# A deviation of the edges at which vagueness neither helps nor harms.
SURE = 0.1


def evidence(sharpness, likeness=1.0, presence=4.0, vagueness=SURE, jump=0.0):
    """Return measured evidence."""
    return Evidence(sharpness, likeness, presence, vagueness, jump)


CLEAR = evidence(10.0)
GONE = evidence(1.0, likeness=0.0, presence=-5.0)


@pytest.fixture(autouse=True)
def coefficients(monkeypatch):
    """Give the trust coefficients of its own, so that a new fit does not change what is tested."""
    for name in ('', 'BELIEF_'):
        monkeypatch.setattr(trust_module, f'{name}MEASURED', TrustModel(
            1.26, 1.53, 0.42, -2.0, 1.81 + 2.0 * math.log(SURE)))
        monkeypatch.setattr(trust_module, f'{name}UNMEASURED', TrustModel(
            2.09, 2.23, 0.0, 0.0, 2.47))


def judge(monitor, evidence):
    """Return the verdict on a frame."""
    return monitor.judge(monitor.assess(evidence))


def believable(monitor, evidence):
    """Return whether a frame is believed to show the target."""
    return monitor.believable(monitor.assess(evidence))


def found_again(monitor, evidence):
    """Return the verdict on a target that is found again and stays what it was."""
    for _ in range(7):
        verdict = judge(monitor, evidence)
    return verdict


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
        below = monitor.assess(evidence(middle, 0.5, 0.0)).score < score
        low, high = (middle, high) if below else (low, middle)
    return evidence(high, 0.5, 0.0)


def test_clear_frames_keep_tracking(monitor):
    for sharpness in (9, 14, 6, 5.1):
        verdict = judge(monitor, evidence(sharpness, presence=4.0))
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


def missed(monitor):
    """Return evidence that is not believed, and says little against the target."""
    return at_score(monitor, 0.15)


def test_target_is_lost_after_enough_misses_in_a_row(monitor):
    assert not believable(monitor, missed(monitor))
    states = [judge(monitor, missed(monitor)).state for _ in range(4)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST] * 2


def test_misses_must_be_in_a_row(monitor):
    for _ in range(5):
        assert judge(monitor, missed(monitor)).state is not TrackState.LOST
        assert judge(monitor, missed(monitor)).state is not TrackState.LOST
        assert judge(monitor, CLEAR).state is TrackState.TRACKING


def test_target_is_lost_in_the_second_frame_that_shows_nothing_of_it(monitor):
    states = [judge(monitor, GONE).state for _ in range(3)]
    assert states == [TrackState.UNCERTAIN] + [TrackState.LOST] * 2


def test_target_is_lost_after_lasting_doubt(monitor):
    # Log-odds of .69 against it, from a belief of .4 on, in each frame; 2 in each of three frames
    # are enough, so in nine of these.
    doubt = at_score(monitor, 0.25)
    verdicts = [judge(monitor, doubt) for _ in range(9)]
    assert [verdict.state for verdict in verdicts] == (
        [TrackState.UNCERTAIN] * 8 + [TrackState.LOST])
    assert [verdict.believed for verdict in verdicts] == [True] * 8 + [False]


def test_target_is_lost_where_the_network_denies_it_for_long(monkeypatch, monitor):
    monkeypatch.setattr(trust_module, 'BELIEF_MEASURED', TrustModel(0.0, 0.0, 0.0, 0.0, 3.0))
    states = [judge(monitor, evidence(10.0, presence=-0.7)).state for _ in range(9)]
    assert TrackState.LOST not in states[:8] and states[8] is TrackState.LOST


def test_one_frame_alone_does_not_lose_the_target_whatever_speaks_against_it(monitor):
    believed = monitor.assess(CLEAR)
    denied = replace(believed, evidence=replace(believed.evidence, presence=-100.0))
    assert [monitor.judge(denied).state is TrackState.LOST for _ in range(2)] == [False, True]


@pytest.mark.parametrize('doubt', [
    {'presence': 0.0, 'belief': 0.9}, {'presence': 4.0, 'belief': 0.4},
    {'presence': None, 'belief': 0.4}])
def test_doubt_that_may_last_does_not_lose_the_target(monitor, doubt):
    seen = monitor.assess(CLEAR)
    seen = replace(seen, evidence=replace(seen.evidence, presence=doubt['presence']),
                   belief=doubt['belief'])
    assert TrackState.LOST not in {monitor.judge(seen).state for _ in range(100)}


def test_frame_that_speaks_for_the_target_outweighs_many(monitor):
    doubt = at_score(monitor, 0.25)
    for _ in range(5):
        for _ in range(8):
            assert judge(monitor, doubt).state is TrackState.UNCERTAIN
        assert judge(monitor, evidence(10.0, presence=6.0)).state is TrackState.TRACKING


def test_doubt_of_a_search_does_not_count_after_it(monitor):
    for _ in range(20):
        judge(monitor, GONE)
    states = [judge(monitor, CLEAR).state for _ in range(4)]
    assert TrackState.LOST not in states[1:]


@pytest.mark.parametrize('lack', [
    evidence(10.0, 0.2, 4.0), evidence(3.5, 1.0, 4.0), evidence(10.0, 1.0, -0.1)],
    ids=['first filter', 'filter', 'network'])
def test_lost_target_is_found_when_all_three_agree(monitor, lack):
    for _ in range(3):
        judge(monitor, GONE)
    lack = replace(lack, jump=1.1)
    assert not convincing(monitor, lack) and not believable(monitor, lack)
    assert judge(monitor, lack).state is TrackState.LOST
    assert convincing(monitor, CLEAR)
    assert found_again(monitor, CLEAR).state is TrackState.TRACKING


def test_after_a_cut_the_target_has_to_convince_but_with_less(monitor):
    weak = evidence(3.5, 1.0, -0.5)
    assert believable(monitor, weak) and not convincing(monitor, weak)
    monitor.note_cut()
    # Half of what convinces otherwise does now; what was enough to go on does not.
    assert convincing(monitor, weak) and monitor.after_cut
    doubtful = at_score(monitor, 0.45)
    assert not believable(monitor, doubtful)
    assert found_again(monitor, weak).state is not TrackState.LOST
    assert not monitor.after_cut and believable(monitor, doubtful)


def test_what_a_cut_excuses_is_forgotten_in_time(monitor):
    weak = evidence(3.5, 1.0, -0.5)
    monitor.note_cut()
    for _ in range(99):
        judge(monitor, GONE)
    assert monitor.after_cut and convincing(monitor, weak)
    assert judge(monitor, GONE).state is TrackState.LOST
    assert not monitor.after_cut and not convincing(monitor, weak)
    # Who convinces as at any other time is found.
    assert found_again(monitor, CLEAR).state is not TrackState.LOST


def test_without_a_network_the_filters_have_to_agree(monitor):
    for _ in range(3):
        judge(monitor, GONE)
    assert not convincing(monitor, Evidence(10.0, 0.2)) and not convincing(monitor, Evidence(3.5))
    assert found_again(monitor, Evidence(9.0)).state is TrackState.TRACKING


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
        verdict = judge(monitor, missed(monitor))
        states.append(verdict.state)
        assert verdict.believed and verdict.learns
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]


def test_reference_is_the_median_of_the_first_frames_only(monitor):
    for _ in range(50):
        judge(monitor, evidence(100.0, presence=4.0))
    assert monitor.assess(Evidence(10.0)).quality == pytest.approx(1)
    late = PresenceMonitor(CONFIG)
    for sharpness in (8, 12, 100, 10):
        judge(late, evidence(sharpness, presence=4.0))
    assert late.assess(Evidence(11.0)).quality == pytest.approx(1)


def test_another_filter_has_a_sharpness_of_its_own(monitor):
    for _ in range(4):
        judge(monitor, evidence(10.0))
    assert monitor.assess(evidence(5.0)).quality == 0.5
    monitor.expect_anew()
    assert monitor.assess(evidence(5.0)).quality == 1.0
    judge(monitor, evidence(5.0))
    assert monitor.assess(evidence(2.5)).quality == 0.5


def test_first_frame_is_believed():
    assert believable(PresenceMonitor(CONFIG), Evidence(0.5))


@pytest.mark.parametrize('sharpness', [0.0, -3.0, float('nan'), float('inf')])
def test_frame_that_shows_nothing_is_not_believed_and_sets_no_reference(sharpness):
    monitor = PresenceMonitor(CONFIG)
    blank = evidence(sharpness, presence=4.0)
    assert monitor.assess(blank).score == 0 and not believable(monitor, blank)
    assert judge(monitor, blank).state is not TrackState.TRACKING
    judge(monitor, Evidence(8.0))
    assert monitor.assess(Evidence(8.0)).quality == pytest.approx(1)


def test_monitors_do_not_share_what_they_saw(monitor):
    other = PresenceMonitor(CONFIG)
    judge(other, evidence(2.0, presence=4.0))
    assert other.assess(Evidence(2.0)).quality == pytest.approx(1)
    assert monitor.assess(Evidence(10.0)).quality == pytest.approx(1)


HALF = evidence(5.0, 0.5, 0.0)
# Missed even by a monitor without a reference, to which every sharpness is as usual.
NOTHING = evidence(1.0, -0.5, -8.0)


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
    above = float(np.nextafter(score, 1))
    monitor = with_thresholds(uncertain=above, certain=1.0)
    assert judge(monitor, HALF).state is TrackState.UNCERTAIN
    assert not monitor.resembles(HALF)
    assert not convincing(with_thresholds(found=above), HALF)


def test_uncertain_target_is_certain_again_at_just_enough():
    monitor = with_thresholds(uncertain=0.9, certain=1.0)
    judge(monitor, evidence(1.0, 0.0, 0.0))
    assert monitor.state is TrackState.UNCERTAIN
    monitor.config = replace(monitor.config, certain=monitor.assess(CLEAR).score)
    assert judge(monitor, CLEAR).state is TrackState.TRACKING


def test_without_a_reference_every_sharpness_is_as_usual(monitor):
    assert PresenceMonitor(CONFIG).assess(Evidence(0.1)).quality == 1
    assert monitor.assess(Evidence(2.5)).quality == 0.25
    assert monitor.assess(Evidence(1e-9)).quality == 1e-10


def test_assessment_holds_what_it_is_made_of(monitor):
    seen = monitor.assess(HALF)
    assert (seen.evidence, seen.quality, seen.likeness) == (HALF, 0.5, 0.5)
    assert seen.score == trust(0.5, 0.5, 0.0, SURE)
    unmeasured = monitor.assess(replace(HALF, presence=None, vagueness=None))
    assert unmeasured.score == trust(0.5, 0.5)


def test_what_is_not_measured_does_not_speak_against_the_target():
    assert Evidence(10.0) == Evidence(10.0, 1.0, presence=None, vagueness=None, jump=0.0)


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
    assert convincing(cut, evidence(2.0, 1.0, 4.0)) and not convincing(cut, evidence(1.99, 1.0, 4))
    assert convincing(cut, evidence(9.0, 0.15, 4.0)) and not convincing(cut, evidence(9, 0.149, 4))
    assert convincing(cut, evidence(9.0, 1.0, -2.0)) and not convincing(cut, evidence(9, 1, -2.01))


def test_otherwise_all_of_it_is_needed(monitor):
    monitor.config = replace(CONFIG, found=0.2)
    assert convincing(monitor, evidence(4.0, 1.0, 4.0))
    assert not convincing(monitor, evidence(3.99, 1.0, 4.0))
    assert convincing(monitor, evidence(9.0, 0.3, 4.0))
    assert not convincing(monitor, evidence(9.0, 0.299, 4.0))
    assert convincing(monitor, evidence(9.0, 1.0, 0.0))
    assert not convincing(monitor, evidence(9.0, 1.0, -0.01))


def test_after_a_cut_a_score_of_one_half_is_enough(cut):
    cut.config = replace(cut.config, sharp=0.0)
    assert convincing(cut, at_score(cut, 0.501)) and not convincing(cut, at_score(cut, 0.499))
    cut.config = replace(cut.config, found=0.4)
    assert convincing(cut, at_score(cut, 0.401)) and not convincing(cut, at_score(cut, 0.399))


def test_what_looks_like_the_target_may_stand_beside_it(monitor):
    """How sharp it is in a score that the target dominates says nothing."""
    assert monitor.resembles(evidence(0.1, 0.5, 0.0))
    assert monitor.resembles(evidence(10.0, 0.3, 4.0))
    assert not monitor.resembles(evidence(10.0, 0.299, 4.0))
    assert not monitor.resembles(evidence(10.0, 0.31, -8.0))
    assert not monitor.resembles(evidence(10.0, 0.31, 0.0, vagueness=0.4))


def test_cut_is_over_when_the_target_is_seen(monitor):
    monitor.note_cut()
    judge(monitor, GONE)
    assert monitor.after_cut
    judge(monitor, CLEAR)
    judge(monitor, CLEAR)
    assert not monitor.after_cut


def test_new_monitor_tracks_and_has_seen_no_cut():
    monitor = PresenceMonitor(CONFIG)
    assert monitor.state is TrackState.TRACKING and not monitor.after_cut
    states = [judge(monitor, NOTHING).state for _ in range(3)]
    assert states == [TrackState.UNCERTAIN] + [TrackState.LOST] * 2


def test_missed_frame_counts_from_zero_after_the_target_was_seen(monitor):
    judge(monitor, missed(monitor))
    judge(monitor, missed(monitor))
    judge(monitor, CLEAR)
    states = [judge(monitor, missed(monitor)).state for _ in range(3)]
    assert states == [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]


def test_lost_target_that_is_hardly_found_is_uncertain(monitor):
    for _ in range(3):
        judge(monitor, GONE)
    monitor.config = replace(CONFIG, found=0.2, sharp=0.0)
    hardly = replace(at_score(monitor, 0.55), jump=1.5)
    assert found_again(monitor, hardly).state is TrackState.UNCERTAIN
    assert judge(monitor, replace(hardly, sharpness=2 * hardly.sharpness)).state is (
        TrackState.TRACKING)


def test_lost_target_is_still_lost_while_it_is_missed(monitor):
    for _ in range(3):
        judge(monitor, GONE)
    monitor.config = replace(CONFIG, lost_frames=100)
    assert judge(monitor, GONE).state is TrackState.LOST


def test_missed_frames_set_no_reference():
    monitor = PresenceMonitor(CONFIG)
    judge(monitor, NOTHING)
    assert monitor.assess(Evidence(2.0)).quality == 1


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
        judge(young, evidence(sharpness, presence=4.0))
    judge(young, evidence(20.0, presence=4.0))
    assert young.assess(Evidence(15.0)).quality == 1
    judge(young, evidence(20.0, presence=4.0))
    assert young.assess(Evidence(15.0)).quality == 1


@pytest.fixture
def lost(monitor):
    """Return a monitor whose target is lost."""
    for _ in range(3):
        judge(monitor, GONE)
    assert monitor.state is TrackState.LOST
    return monitor


def test_lost_target_is_found_by_two_frames_that_agree(lost):
    first = judge(lost, replace(CLEAR, jump=30.0))
    assert first.promising and not first.believed and first.state is TrackState.LOST
    second = judge(lost, replace(CLEAR, jump=2.0))
    assert second.believed and not second.promising and second.state is TrackState.UNCERTAIN


@pytest.mark.parametrize('other', [GONE, replace(CLEAR, jump=2.1), evidence(2.5, 0.1, -2.0)],
                         ids=['nothing', 'elsewhere', 'not convincing'])
def test_what_the_next_frame_does_not_see_there_is_not_believed(lost, other):
    judge(lost, CLEAR)
    verdict = judge(lost, other)
    assert not verdict.believed and verdict.state is TrackState.LOST
    assert judge(lost, CLEAR).promising


def test_target_out_of_its_region_needs_two_frames_and_one_within_it_one(monitor):
    likely = at_score(monitor, 0.82)
    assert judge(monitor, replace(likely, jump=2.5)).believed
    far = judge(monitor, replace(likely, jump=2.6))
    assert far.promising and not far.believed and far.state is TrackState.UNCERTAIN
    assert judge(monitor, CLEAR).believed


def test_where_all_speaks_for_the_target_out_of_its_region_one_frame_is_enough(monitor):
    far = replace(at_score(monitor, 0.86), jump=2.6)
    verdict = judge(monitor, far)
    assert verdict.believed and verdict.state is TrackState.UNCERTAIN and not verdict.learns
    assert judge(monitor, GONE).state is TrackState.LOST


def test_one_frame_is_never_enough_for_a_lost_target(lost):
    assert not judge(lost, replace(CLEAR, jump=2.6)).believed


def test_part_of_the_target_is_enough_shortly_after_a_cut(monkeypatch, monitor):
    part = replace(at_score(monitor, 0.86), jump=10.0)
    unsure = replace(trust_module.MEASURED, constant=trust_module.MEASURED.constant - 3)
    monkeypatch.setattr(trust_module, 'MEASURED', unsure)
    assert not convincing(monitor, part)
    monitor.note_cut()
    for _ in range(CONFIG.lost_frames):
        assert convincing(monitor, part)
        judge(monitor, GONE)
    assert not convincing(monitor, part)


def test_part_of_what_did_not_stand_out_is_not_enough_after_a_cut(monkeypatch):
    doubted, sure = PresenceMonitor(CONFIG), PresenceMonitor(CONFIG)
    doubted.start(evidence(10.0, presence=-1.0, vagueness=0.4))
    sure.start(CLEAR)
    part = at_score(sure, 0.86)
    unsure = replace(trust_module.MEASURED, constant=trust_module.MEASURED.constant - 3)
    monkeypatch.setattr(trust_module, 'MEASURED', unsure)
    for monitor in (doubted, sure):
        monitor.note_cut()
    assert convincing(sure, part) and not convincing(doubted, part)


def test_what_did_not_stand_out_has_to_convince_where_it_was_after_a_cut():
    doubted, sure = PresenceMonitor(CONFIG), PresenceMonitor(CONFIG)
    doubted.start(evidence(10.0, presence=-1.0, vagueness=0.4))
    sure.start(CLEAR)
    likely = evidence(10.0, 0.1)
    for monitor in (doubted, sure):
        monitor.note_cut()
        assert monitor.assess(likely).belief > 0.5 and not convincing(monitor, likely)
    assert believable(sure, likely) and not believable(doubted, likely)


def test_after_a_cut_two_frames_have_to_agree_on_what_has_moved(monitor):
    monitor.note_cut()
    first = judge(monitor, replace(at_score(monitor, 0.82), jump=1.1))
    assert first.promising and not first.believed


def test_what_overwhelms_out_of_its_region_has_to_convince_as_well(monitor):
    far = evidence(10.0, 0.29, presence=20.0, jump=2.6)
    assert monitor.assess(far).score > 0.85 and not convincing(monitor, far)
    assert not believable(monitor, far)


def test_score_that_just_overwhelms_is_enough():
    score = first_score(CLEAR)
    far = replace(CLEAR, jump=2.6)
    assert 0.85 < score < 1 and judge(with_thresholds(found=score), far).believed
    assert not judge(with_thresholds(found=float(np.nextafter(score, 1))), far).believed


def test_found_again_is_learned_from_after_probation(lost):
    judge(lost, CLEAR)
    states = [judge(lost, CLEAR).state for _ in range(6)]
    assert states == [TrackState.UNCERTAIN] * 5 + [TrackState.TRACKING]


def test_claim_that_the_next_frames_contradict_is_given_up_at_once(lost):
    judge(lost, CLEAR)
    assert judge(lost, CLEAR).state is TrackState.UNCERTAIN
    # Enough for a target that was never lost.
    verdict = judge(lost, at_score(lost, 0.45))
    assert verdict.state is TrackState.LOST and not verdict.believed


def test_target_that_has_passed_its_probation_is_doubted_as_any_other(lost):
    found_again(lost, CLEAR)
    assert judge(lost, at_score(lost, 0.25)).believed
    assert judge(lost, GONE).state is TrackState.UNCERTAIN


def test_start_on_what_stands_out_tracks():
    monitor = PresenceMonitor(CONFIG)
    verdict = monitor.start(CLEAR)
    assert verdict == Verdict(monitor.assess(CLEAR).score, TrackState.TRACKING, True, True)


def test_start_on_what_does_not_stand_out_is_uncertain_until_it_does():
    monitor = PresenceMonitor(CONFIG)
    vague = evidence(10.0, presence=-1.0, vagueness=0.4)
    verdict = monitor.start(vague)
    assert verdict.score < CONFIG.certain
    told = 'start: nothing stands out'
    assert verdict == Verdict(verdict.score, TrackState.UNCERTAIN, True, False, note=told)
    again = judge(monitor, vague)
    assert (again.state, again.note) == (TrackState.UNCERTAIN, told)
    assert judge(monitor, CLEAR) == Verdict(
        monitor.assess(CLEAR).score, TrackState.TRACKING, True, True)
    assert judge(monitor, vague).note == ''


def test_noise_lowers_what_is_expected_of_sharpness_and_likeness(monitor):
    dimmed = evidence(4.0, 0.6, 3.0)
    before = monitor.assess(dimmed)
    monitor.note_noise(0.1)
    after = monitor.assess(dimmed)
    assert after.quality > 2 * before.quality and after.likeness > before.likeness
    assert after.score > before.score
    monitor.config = replace(CONFIG, found=0.3, sharp=0.5)
    assert monitor.convincing(after) and not monitor.convincing(before)
    # What resembles the target has not become more like it by itself.
    assert monitor.resembles(evidence(1.0, 0.25, 0.0))


def test_presence_and_sharpness_that_may_convince_are_told(monitor):
    assert monitor.present(0.0) and not monitor.present(-0.1)
    # A fifth of the reference: half of `sharp`.
    assert monitor.hints(2.0) and not monitor.hints(1.99)
    monitor.note_cut()
    assert monitor.present(-2.0) and not monitor.present(-2.1)


def test_target_is_lost_after_a_cut_until_it_is_seen(monitor):
    monitor.note_cut()
    assert judge(monitor, GONE).state is TrackState.LOST
    first = judge(monitor, replace(CLEAR, jump=1.1))
    assert first.promising and first.state is TrackState.LOST
    assert judge(monitor, CLEAR).state is TrackState.UNCERTAIN


def test_target_that_stays_through_a_cut_is_believed_at_once(monitor):
    monitor.note_cut()
    verdict = judge(monitor, replace(CLEAR, jump=1.0))
    assert verdict.believed and verdict.state is TrackState.TRACKING


def test_search_hurries_as_long_as_the_target_is_not_lost_and_after_a_cut(monitor):
    hurried = []
    for _ in range(4):
        hurried.append(monitor.hurried)
        judge(monitor, GONE)
    assert hurried == [True, True, True, False]
    monitor.note_cut()
    hurried = []
    for _ in range(4):
        hurried.append(monitor.hurried)
        judge(monitor, GONE)
    assert hurried == [True, True, True, False]


def test_lost_target_that_did_not_move_needs_no_more_than_to_be_likely(lost):
    alike = evidence(10.0, 0.2)
    assert not convincing(lost, alike) and lost.assess(alike).belief > 0.5
    assert not believable(lost, replace(alike, jump=1.1))
    assert judge(lost, alike).promising and judge(lost, alike).believed


def test_frame_is_believed_by_what_speaks_for_the_target_and_not_for_the_box(monkeypatch, monitor):
    """Where a half of it is seen, the box is told not to cover it, and follows."""
    monkeypatch.setattr(trust_module, 'BELIEF_MEASURED', TrustModel(0.0, 0.0, 0.0, 0.0, 3.0))
    poor = at_score(monitor, 0.1)
    verdict = judge(monitor, poor)
    assert verdict.believed and verdict.score == pytest.approx(0.1, abs=0.01)
    assert verdict.state is TrackState.UNCERTAIN


def test_doubted_start_is_lost_by_its_score_until_it_stands_out(monkeypatch):
    monkeypatch.setattr(trust_module, 'BELIEF_MEASURED', TrustModel(0.0, 0.0, 0.0, 0.0, 3.0))
    nothing = evidence(10.0, 0.3, -1.5, vagueness=0.5)
    for first, states in ((nothing, [TrackState.UNCERTAIN] * 2 + [TrackState.LOST]),
                          (CLEAR, [TrackState.UNCERTAIN] * 3)):
        monitor = PresenceMonitor(CONFIG)
        monitor.start(first)
        assert monitor.assess(nothing).score < 0.2
        assert [judge(monitor, nothing).state for _ in range(3)] == states


def test_doubted_start_goes_on_with_a_score_of_a_fifth(monkeypatch):
    monkeypatch.setattr(trust_module, 'BELIEF_MEASURED', TrustModel(0.0, 0.0, 0.0, 0.0, 3.0))
    monitor = PresenceMonitor(CONFIG)
    monitor.start(evidence(10.0, presence=-1.0, vagueness=0.4))
    seen = monitor.assess(CLEAR)
    assert monitor.believable(replace(seen, score=0.21))
    assert not monitor.believable(replace(seen, score=0.19))


def test_first_frame_has_to_show_a_little_more_than_a_later_one(monitor):
    monitor.config = replace(CONFIG, certain=0.5)
    assert monitor.start(at_score(monitor, 0.59)).note
    assert not monitor.start(at_score(monitor, 0.61)).note


def test_score_of_a_doubted_start_is_halved_until_it_convinces():
    monitor = PresenceMonitor(CONFIG)
    monitor.start(evidence(10.0, presence=-1.0, vagueness=0.4))
    sure = at_score(monitor, 0.7)
    monitor.start(evidence(10.0, presence=-1.0, vagueness=0.4))
    verdict = monitor.judge(replace(monitor.assess(sure), score=0.79))
    assert verdict.state is TrackState.UNCERTAIN and verdict.score == pytest.approx(0.395)
    verdict = monitor.judge(replace(monitor.assess(sure), score=0.81))
    assert verdict.state is TrackState.TRACKING and verdict.score == pytest.approx(0.81)
