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

"""Measures of single benchmarks, against figures that were counted by hand."""

import numpy as np
import pytest

from lmsco_ros.evaluation.report.tables import benchmark_table
from lmsco_ros.evaluation.run_file import EvaluationRun, SequenceInfo
from lmsco_ros.evaluation.summaries.benchmarks import (
    nearer_figures, state_accuracy, summarize_benchmarks)
from lmsco_ros.evaluation.trace import Trace

NAN = float('nan')
BOX = (10., 10., 10., 10.)


def answers(*boxes, lost=()):
    """Return a trace of boxes."""
    marks = np.zeros(len(boxes), bool)
    marks[list(lost)] = True
    return Trace(np.array(boxes), np.full(len(boxes), NAN), marks, (0,), updates=len(boxes) - 1,
                 cpu_seconds=1., wall_seconds=1.)


def run_of(*pairs):
    """Return the run of one tracker on sequences of true boxes and traces."""
    infos = tuple(SequenceInfo(f's{index}', 'set', (100, 100), np.array(truth), {})
                  for index, (truth, _) in enumerate(pairs))
    return EvaluationRun('ope', infos, {'one': tuple(trace for _, trace in pairs)})


NOTHING = (NAN,) * 4
# Overlaps 1/3 and 9/11, and center errors of 5 and 1 pixels.
HALF, NEAR = (15., 10., 10., 10.), (11., 10., 10., 10.)


def test_overlap_of_got10k_is_over_frames_after_the_first():
    summary, = summarize_benchmarks(run_of(
        ([BOX] * 4, answers(BOX, HALF, NEAR, NEAR)), ([BOX] * 2, answers(BOX, BOX))))
    assert summary.average_overlap.value == pytest.approx((1 / 3 + 9 / 11 * 2 + 1) / 4)
    assert summary.success_50.value == summary.success_75.value == pytest.approx(3 / 4)


def test_got10k_counts_what_lies_in_the_image_and_no_absent_frame():
    edge, beyond = (90., 10., 10., 10.), (90., 10., 20., 10.)
    summary, = summarize_benchmarks(run_of(([edge, edge, NOTHING], answers(edge, beyond, BOX))))
    assert summary.average_overlap.value == pytest.approx(1)


def test_normalized_precision_of_lasot_is_at_a_fifth_of_the_size():
    summary, = summarize_benchmarks(run_of(
        ([BOX] * 4, answers(BOX, HALF, NEAR, (12.1, 10., 10., 10.)))))
    assert summary.normalized_precision_20.value == pytest.approx(2 / 4)


@pytest.mark.parametrize('truth, trace, expected', [
    ([BOX, BOX], answers(BOX, HALF), (1 + 1 / 3) / 2),
    ([BOX, NOTHING], answers(BOX, NOTHING), 1),
    ([BOX, NOTHING], answers(BOX, HALF, lost=[1]), 1),
    ([BOX, NOTHING], answers(BOX, HALF), .5),
    ([BOX, BOX], answers(BOX, BOX, lost=[1]), .5),
    ([BOX, BOX], answers(BOX, NOTHING), .5)])
def test_state_accuracy_rewards_overlap_and_true_absence(truth, trace, expected):
    run = run_of((truth, trace))
    overlap = run.sequences[0].overlaps(trace, in_image=False)
    assert state_accuracy(overlap, trace) == pytest.approx(expected)
    assert summarize_benchmarks(run)[0].state_accuracy.value == pytest.approx(expected)


def test_maximum_rates_take_the_nearer_channel():
    truth, other = [BOX] * 4, [HALF, HALF, NOTHING, (60., 10., 10., 10.)]
    info = SequenceInfo('two', 'set', (100, 100), np.array(truth), {},
                        other_truth=np.array(other))
    trace = answers(BOX, HALF, BOX, (40., 10., 10., 10.))
    success, precision = nearer_figures(info, trace)
    # Overlaps 1, 1, 1 and 0: twenty of 21 thresholds are below 1.
    assert success == pytest.approx(3 / 4 * 20 / 21)
    assert precision == pytest.approx(1)
    alone, = summarize_benchmarks(run_of((truth, trace)))
    assert np.isnan(alone.maximum_success.value)
    again = SequenceInfo.from_json(info.to_json())
    np.testing.assert_array_equal(again.other_truth, info.other_truth)


def test_columns_of_two_channels_are_there_where_there_are_two():
    truth = np.array([BOX] * 3)
    run = run_of((truth, answers(BOX, BOX, BOX)))
    assert 'MSR (RGBT234)' not in benchmark_table(summarize_benchmarks(run)).columns
    infos = (SequenceInfo('two', 'set', (100, 100), truth, {}, other_truth=truth),)
    both = EvaluationRun('ope', infos, run.traces)
    assert benchmark_table(summarize_benchmarks(both)).columns[-2:] == (
        'MSR (RGBT234)', 'MPR 20 px')
