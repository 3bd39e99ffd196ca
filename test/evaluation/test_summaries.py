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

"""Figures of whole runs against hand-computed values."""

from dataclasses import replace
import math

import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.per_attribute import box_attributes
from lmsco_ros.evaluation.run_file import EvaluationRun, SequenceInfo
from lmsco_ros.evaluation.summaries.attributes import attribute_source, summarize_attributes
from lmsco_ros.evaluation.summaries.confidence import confidence_parts, summarize_confidence
from lmsco_ros.evaluation.summaries.consistency import consistency_parts, summarize_consistency
from lmsco_ros.evaluation.summaries.differences import differences, reference_of
from lmsco_ros.evaluation.summaries.one_pass import summarize_one_pass
from lmsco_ros.evaluation.summaries.score import summarize_scores
from lmsco_ros.evaluation.summaries.starts import StartSummary, summarize_starts
from lmsco_ros.evaluation.summaries.supervised import eao_interval, summarize_supervised
from lmsco_ros.evaluation.trace import Trace


def sequence(name, frames, attributes=None):
    """Return a sequence with a target that stands still."""
    truth = np.tile([10., 10, 10, 10], (frames, 1))
    return SequenceInfo(name, 'group', (100, 100), truth, attributes or {})


def trace(overlaps, starts=(0,), failures=(), scores=None, lost=(), seconds=1.0):
    """Return answers that overlap the target as stated (a box of that height, 0: none)."""
    boxes = np.array([[10, 10, 10, 10 * value] if value else [50, 50, 10, 10]
                      for value in overlaps], dtype=float)
    marks = np.zeros(len(overlaps), bool)
    marks[list(lost)] = True
    return Trace(boxes, np.array(scores if scores else [np.nan] * len(overlaps)), marks, starts,
                 failures, updates=len(overlaps) - 1, cpu_seconds=seconds,
                 wall_seconds=2 * seconds)


def test_one_pass_means_are_over_sequences_and_rates_over_frames():
    run = EvaluationRun('ope', (sequence('a', 2), sequence('b', 4)), {
        'one': (trace([1, 1]), trace([.5] * 4, seconds=3))})
    (summary,) = summarize_one_pass(run)
    # Overlap 1 lies above 20 of 21 thresholds, overlap .5 above 10.
    assert summary.success_auc.value == pytest.approx((20 / 21 + 10 / 21) / 2)
    assert summary.cpu_rate.value == pytest.approx((1 + 3) / (1 + 3))
    assert summary.wall_rate.value == pytest.approx(4 / 8)
    assert summary.crashes == ()


def test_supervised_figures_by_hand():
    perfect = [1] * 20
    broken = [1] * 12 + [0] + [0] * 4 + [1] * 3
    run = EvaluationRun('vot', (sequence('a', 20), sequence('b', 20)), {
        'good': (trace(perfect), trace([.5] * 20)),
        'bad': (trace(broken, (0, 17), (12,)), trace([.5] * 20))})
    good, bad = summarize_supervised(run)
    assert good.accuracies.tolist() == [1, .5]
    assert bad.accuracies.tolist() == [1, .5]
    assert bad.failures.tolist() == [1, 0]
    assert bad.failures_per_100_frames.value == pytest.approx(100 / 40)
    assert bad.reliability.value == pytest.approx(math.exp(-30 / 40))
    assert bad.reliability.low <= bad.reliability.value <= bad.reliability.high
    assert (good.robustness_rank, bad.robustness_rank) == (1.25, 1.75)
    assert good.accuracy_rank == bad.accuracy_rank == 1.5
    # The longest sequence has 20 frames: the interval shrinks to that one length. There
    # the failed fragment counts 11 of 19 frames, the still one .5, the last says nothing.
    assert eao_interval(run) == (20, 20)
    assert good.eao.value == pytest.approx(.75)
    assert bad.eao.value == pytest.approx((11 / 19 + .5) / 2)


def test_failures_where_the_target_jumps_are_counted_apart():
    truth = np.tile([10., 10, 10, 10], (20, 1))
    truth[12:] += [60, 0, 0, 0]
    cut = SequenceInfo('cut', 'group', (100, 100), truth, {})
    run = EvaluationRun('vot', (cut,), {
        'one': (trace([1] * 20, (0, 8, 17), (3, 12)),), 'other': (trace([1] * 20),)})
    assert [summary.at_jumps for summary in summarize_supervised(run)] == [1, 0]


def test_python_convention_forgets_what_comes_after_the_longest_fragment():
    overlaps = [1] * 5 + [0] * 5
    run = EvaluationRun('vot', (sequence('a', 40),), {
        'weak': (trace(overlaps * 4, (0, 10, 20, 30), (5, 15, 25, 35)),)})
    (summary,) = summarize_supervised(run)
    assert summary.eao.value < 0.15
    assert math.isnan(summary.eao_python.value)


def test_groups_can_be_taken_alone():
    infos = (sequence('a', 2), SequenceInfo('b', 'other', (9, 9), np.ones((2, 4)), {}))
    run = EvaluationRun('ope', infos, {'one': (trace([1, 1]), trace([0, 0]))})
    part = run.only(('other',))
    assert [item.name for item in part.sequences] == ['b']
    assert len(part.traces['one']) == 1
    assert run.only(None).sequences == infos


def test_attributes_pool_annotated_sequences_only():
    flags = {'occlusion': np.array([False, True]), 'empty': np.array([True, False])}
    run = EvaluationRun('ope', (sequence('a', 2, flags), sequence('b', 2)), {
        'one': (trace([1, .5]), trace([.1, .1]))})
    figures = summarize_attributes(run)['one']
    assert list(figures) == ['occlusion', 'empty'] and 'annotated' in attribute_source(run)
    assert figures['occlusion'].mean_overlap == pytest.approx(.5)
    assert figures['empty'].mean_overlap == pytest.approx(1)


def test_true_boxes_tell_attributes_where_nobody_annotated_any():
    run = EvaluationRun('ope', (sequence('a', 2), sequence('b', 2)), {
        'one': (trace([1, .5]), trace([.1, .4]))})
    figures = summarize_attributes(run)['one']
    assert list(figures) == ['aspect_ratio_change', 'fast_motion', 'low_resolution',
                             'scale_variation', 'empty']
    assert figures['low_resolution'].frames == 4
    assert figures['low_resolution'].mean_overlap == pytest.approx(.5)
    assert figures['empty'].frames == 0 and 'LaSOT' in attribute_source(run)


def test_attributes_by_boxes():
    boxes = np.array([
        [0, 0, 40, 40],    # nothing
        [40, 0, 40, 40],   # as far as it is large
        [81, 0, 40, 40],   # farther
        [81, 0, 57, 57],   # 2.03 times the area
        [np.nan] * 4,
        [0, 0, 56, 28],    # width over height 2, area .98
        [0, 0, 60, 29],    # above 2
        [0, 0, 20, 39],    # .4875 of the area, 780 pixels, .51 wide for its height
        [10, -20, 80, 80]])  # 40 pixels from one of 28; four times the area
    flags = {name: np.flatnonzero(values).tolist()
             for name, values in box_attributes(boxes).items()}
    assert flags == {'fast_motion': [2, 8], 'scale_variation': [3, 7, 8],
                     'aspect_ratio_change': [6], 'low_resolution': [7], 'empty': [0, 1, 5]}


def test_confidence_pools_sequences():
    run = EvaluationRun('ope', (sequence('a', 2), sequence('b', 2)), {
        'one': (trace([1, .1], scores=[.9, .3]), trace([1, 1], scores=[.8, .2], lost=[1]))})
    (summary,) = summarize_confidence(run)
    assert summary.false_alarms.value == pytest.approx(1000 / 4)
    assert summary.recovered_share.value == 0
    assert summary.lost_share.value == pytest.approx(1 / 4)
    assert summary.departures == 0 and math.isnan(summary.delay)


def test_absences_and_returns_pool_sequences():
    truth = np.tile([10., 10, 10, 10], (50, 1))
    truth[5:15] = np.nan
    infos = tuple(SequenceInfo(name, 'group', (100, 100), truth, {}, challenge)
                  for name, challenge in (('a', 'leave'), ('b', 'leave'), ('c', 'twin')))
    found = trace([1] * 20 + [1] * 30, lost=range(8, 17))
    elsewhere = trace([1] * 5 + [0] * 45)
    run = EvaluationRun('ope', infos, {'one': (found, elsewhere, found)})
    (summary,) = summarize_confidence(run.only(challenge='leave'))
    assert (summary.departures, summary.declared, summary.delay) == (2, 1, 3)
    assert summary.declared_soon == 1
    assert summary.absent == 20
    assert summary.claimed_share.value == pytest.approx((3 + 10) / 20)
    assert (summary.returns, summary.found, summary.found_delay) == (2, 1, 2)
    assert summary.found_share.value == pytest.approx(1 / 2)
    assert summary.mistaken == 1
    assert [(name, len(part.sequences)) for name, part in confidence_parts(run)] == [
        ('leave', 2), ('twin', 1)]


def test_absence_that_is_declared_late_is_not_declared_soon():
    truth = np.tile([10., 10, 10, 10], (50, 1))
    truth[5:] = np.nan
    info = SequenceInfo('a', 'group', (100, 100), truth, {})
    run = EvaluationRun('ope', (info, info), {
        'one': (trace([1] * 50, lost=[34]), trace([1] * 50, lost=[35]))})
    (summary,) = summarize_confidence(run)
    assert (summary.declared, summary.declared_soon) == (2, 1)


def test_scores_are_pooled_and_averaged_over_sequences():
    run = EvaluationRun('ope', (sequence('a', 4), sequence('b', 2), sequence('c', 2)), {
        'one': (trace([1, 1, .1, .1], scores=[.9, .3, .35, .2]),
                trace([1, .1], scores=[.8, .1]), trace([1, 1], scores=[.7, .7])),
        'silent': (trace([1] * 4), trace([1] * 2), trace([1] * 2))})
    one, silent = summarize_scores(run)
    # Of the pairs of good .9 .3 .8 .7 .7 and bad .35 .2 .1 only .3 and .35 are out of order.
    assert one.auroc.value == pytest.approx(14 / 15)
    assert one.mean_auroc.value == pytest.approx((3 / 4 + 1) / 2)
    # Bins of .1, .2, .3 to .4 (half good), .7, .8, .9.
    gaps = .1 + .2 + (.65 - 1) * -1 + .6 + .2 + .1
    assert one.calibration_error.value == pytest.approx(gaps / 8)
    assert math.isnan(silent.auroc.value) and math.isnan(silent.calibration_error.value)
    assert silent.calibration.frames.sum() == 0


def test_starts_are_pooled_by_what_they_are_on():
    there = np.tile([10., 10, 10, 10], (40, 1))
    nothing = there.copy()
    nothing[1:] = np.nan
    infos = [SequenceInfo(name, 'group', (100, 100), truth, {})
             for name, truth in (('a', there), ('b', nothing), ('c', nothing), ('d', there[:9]))]
    low, high = [.4] * 40, [.9] * 40
    run = EvaluationRun('ope', tuple(infos), {
        'one': (trace([1] * 40, scores=high), trace([1] * 40, scores=low),
                trace([1] * 40, scores=high, lost=[25]), trace([1] * 9, scores=[.1] * 9)),
        'other': (trace([1] * 40, scores=low, lost=[8]), trace([1] * 40, scores=high),
                  trace([1] * 40, scores=high), trace([1] * 9))})
    assert summarize_starts(run) == (StartSummary('one', 2, 1, 1, 1, 0, 0),
                                     StartSummary('other', 2, 0, 0, 1, 1, 1))


def test_consistency_is_told_of_all_frames_and_of_those_that_are_followed():
    def told(plain, offset, variance):
        predicted = plain.boxes + [offset, 0, 0, 0]
        return replace(plain, predicted=predicted, covariances=np.tile(
            variance * np.eye(4), (len(predicted), 1, 1)))
    run = EvaluationRun('ope', (sequence('a', 4), sequence('b', 4)), {
        'silent': (trace([1] * 4), trace([1] * 4)),
        'one': (told(trace([1] * 4), 2, 1), told(trace([1] * 4, lost=[2, 3]), 3, 9))})
    (one,) = summarize_consistency(run)
    assert one.tracker == 'one' and one.everywhere.frames == 8 and one.followed.frames == 6
    assert one.everywhere.mean.value == pytest.approx((4 * 4 + 4 * 1) / 8)
    assert one.followed.mean.value == pytest.approx((4 * 4 + 2 * 1) / 6)
    assert one.followed.factor == pytest.approx(1.5) and one.followed.median == 4
    assert one.everywhere.inside.value == 1
    assert one.band == pytest.approx((0.4844 / 2, 11.143 / 2), rel=1e-3)
    assert [title for title, _ in consistency_parts(run)] == ['group']


def test_sequence_without_a_target_after_the_start_has_no_accuracy():
    truth = np.tile([10., 10, 10, 10], (50, 1))
    truth[1:] = np.nan
    nothing = SequenceInfo('a', 'group', (100, 100), truth, {})
    run = EvaluationRun('ope', (nothing, sequence('b', 2)), {'one': (trace([1] * 50),
                                                                     trace([1, 1]))})
    (summary,) = summarize_one_pass(run)
    assert math.isnan(summary.aucs[0]) and summary.success_auc.value == pytest.approx(20 / 21)
    assert summary.success[0] == 1 and np.isfinite(summary.precision).all()
    (alone,) = summarize_one_pass(EvaluationRun('ope', (nothing,), {'one': (trace([1] * 50),)}))
    assert math.isnan(alone.success_auc.value) and np.isnan(alone.success).all()


def test_a_run_without_challenges_is_judged_as_one():
    run = EvaluationRun('ope', (sequence('a', 2), sequence('b', 2)), {
        'one': (trace([1, 1]), trace([1, 1]))})
    assert run.challenges == () and confidence_parts(run) == [('', run)]
    (summary,) = summarize_confidence(run)
    assert summary.returns == summary.absent == 0
    assert math.isnan(summary.claimed_share.value) and math.isnan(summary.found_share.value)


def test_differences_are_to_csrt_or_the_first():
    assert reference_of(('hcs',)) is None
    assert reference_of(('hcs', 'kcf')) == 'hcs'
    figures = {'hcs': np.array([.9, .8, .3]), 'csrt': np.array([.5, .5, .4])}
    (row,) = differences(figures, higher_is_better=True)
    assert (row.tracker, row.reference, row.better, row.worse) == ('hcs', 'csrt', 2, 1)
    assert row.difference.value == pytest.approx((.4 + .3 - .1) / 3)
    (reverse,) = differences(figures, higher_is_better=False)
    assert (reverse.better, reverse.worse) == (1, 2)


@pytest.mark.parametrize(('sequences', 'gain', 'real'), [
    (6, .1, True), (6, -.1, True), (5, .1, False), (6, 0, False)])
def test_a_difference_is_real_with_enough_sequences_and_an_interval_beside_zero(
        sequences, gain, real):
    values = np.linspace(.2, .8, sequences)
    (row,) = differences({'hcs': values + gain, 'csrt': values}, higher_is_better=True)
    assert row.real is real
