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

"""Several starts: which parts there are, and their figures against hand-computed values."""

import math
import pickle

import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.datasets.parts import anchored_parts, AnchorPlan
from lmsco_ros.evaluation.datasets.sequence import Origin
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.protocols.anchors import part_outcome, touches_border
from lmsco_ros.evaluation.run_file import EvaluationRun, SequenceInfo
from lmsco_ros.evaluation.summaries.anchors import anchor_interval, summarize_anchors
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers import resolve

TRACK, MISS, REFUSE = 0, 1, 5


class Numbered:
    """Frames of which each is an image of its own number."""

    signature = 'numbered'

    def __init__(self, count):
        self.count = count
        self.read = []

    def __len__(self):
        return self.count

    def __getitem__(self, index):
        self.read.append(index)
        return np.full((4, 4), index)


@pytest.fixture
def whole():
    """Return a function that makes a sequence with a target in all frames but some."""
    def make(frames, absent=()):
        truth = np.tile([10., 10, 10, 10], (frames, 1)) + np.arange(frames)[:, None]
        truth[list(absent)] = np.nan
        attributes = {'first': np.arange(frames) < 3}
        return TrackingSequence('walk', 'group', Numbered(frames), truth, attributes)
    return make


def spans(parts):
    """Return the first and last frame of each part."""
    return [(int(part.frames[0][0, 0]), int(part.frames[len(part) - 1][0, 0])) for part in parts]


def test_parts_go_where_the_sequence_is_longer(whole):
    parts = anchored_parts(whole(121), AnchorPlan())
    assert spans(parts) == [(0, 120), (50, 120), (100, 0)]
    assert [part.name for part in parts] == ['walk@0-120', 'walk@50-120', 'walk@100-0']
    assert all(part.origin == Origin('group/walk', 121) for part in parts)
    back = parts[2]
    assert [int(back.frames[index][0, 0]) for index in (0, 1, 100)] == [100, 99, 0]
    assert back.ground_truth[:2, 0].tolist() == [110, 109]
    assert np.flatnonzero(back.attributes['first']).tolist() == [98, 99, 100]


def test_going_back_decodes_forward(whole):
    sequence = whole(201)
    back = anchored_parts(sequence, AnchorPlan(spacing=150))[1]
    assert [int(back.frames[index][0, 0]) for index in range(151)] == list(range(150, -1, -1))
    read = sequence.frames.read
    assert sorted(read) == list(range(151))
    # The start, and then blocks: a film starts again as often as the next frame is an earlier one.
    assert sum(later < earlier for earlier, later in zip(read, read[1:])) == 3
    assert len(pickle.dumps(back.frames)) < 1000


def test_the_middle_goes_forward(whole):
    # Frame 2 of 5 is as far from the end as from the beginning.
    assert spans(anchored_parts(whole(5), AnchorPlan(spacing=2))) == [(0, 4), (2, 4), (4, 0)]


def test_parts_of_a_length_go_forward_to_the_end(whole):
    parts = anchored_parts(whole(130), AnchorPlan(spacing=50, length=60))
    assert spans(parts) == [(0, 59), (50, 109), (100, 129)]


def test_starts_wait_for_the_target_and_need_a_later_frame_with_one(whole):
    # 0 waits for 3; 4 waits for 8, where 8 starts as well; 12 has no later frame with a target.
    sequence = whole(16, absent=(0, 1, 2, 4, 5, 6, 7, 13, 14, 15))
    assert spans(anchored_parts(sequence, AnchorPlan(4, 20))) == [(3, 15), (8, 15)]
    assert spans(anchored_parts(sequence, AnchorPlan(4))) == [(3, 15), (8, 0), (12, 0)]
    assert spans(anchored_parts(whole(9, absent=(5, 6, 7, 8)), AnchorPlan(5))) == [(0, 8)]


def test_a_sequence_without_a_second_target_has_no_parts(whole):
    with pytest.raises(SequenceError, match='group/walk: no start has a later frame'):
        anchored_parts(whole(9, absent=range(1, 9)), AnchorPlan())


def test_parts_have_records_of_their_own(whole):
    sequence = whole(200)
    found = {part.fingerprint for plan in (AnchorPlan(), AnchorPlan(50, 60), AnchorPlan(50, 70))
             for part in anchored_parts(sequence, plan)}
    # Starts 0, 50, 100 and 150 of three kinds; the last 50 frames are the same for two.
    assert len(found) == 11


@pytest.mark.parametrize(('overlap', 'survived', 'failed'), [
    ([1] + [.8] * 14, 15, False),
    # Ten frames in a row, the first of them at 3, without recovery.
    ([1, .5, .5] + [.1] * 10 + [.9] * 2, 3, True),
    # Recovery in the tenth frame; then the part ends before ten more are over.
    ([1, .5, .5] + [.1] * 9 + [.11] + [0] * 9, 22, False),
    # Two losses; the second lasts.
    ([1] + [0] * 9 + [.5] + [0] * 10, 11, True),
    # Without any answer.
    ([0] * 12, 0, True),
    # Frames without a target neither fail nor recover.
    ([1, .5] + [0, np.nan] * 9 + [0], 2, True),
    ([1, .5] + [0, np.nan] * 9, 11, False),
])
def test_failure_is_ten_frames_without_recovery(overlap, survived, failed):
    outcome = part_outcome(np.array(overlap, dtype=float))
    assert (outcome.survived, outcome.fragment.failed) == (survived, failed)
    assert outcome.frames == np.isfinite(overlap).sum()


def test_boxes_that_touch_or_leave_the_image_are_at_its_border():
    boxes = np.array([[0, 5, 5, 5], [5, -2, 5, 5], [15, 5, 5, 5], [5, 5, 5, 9.5], [.9, 5, 5, 5],
                      [1, 1, 18, 13], [5, 5, 5, 5]], dtype=float)
    assert touches_border(boxes, (20, 15)).tolist() == [True] * 5 + [False] * 2


def info(name, frames, whole_frames, corner=(10., 10.)):
    """Return a part of a sequence with a target that stands still."""
    return SequenceInfo(f'{name}@0', 'group', (100, 100), np.tile([*corner, 10, 10], (frames, 1)),
                        {}, origin=Origin(f'group/{name}', whole_frames))


def trace(part, overlaps):
    """Return answers that overlap the target as stated (a box of that height, 0: none)."""
    x, y, width, height = part.ground_truth[0]
    boxes = np.array([[x, y, width, height * value] if value else [80, 80, 10, 10]
                      for value in overlaps], dtype=float)
    return Trace(boxes, np.full(len(boxes), np.nan), np.zeros(len(boxes), bool), starts=(0,))


@pytest.fixture
def run():
    """Return a run of one tracker on two parts of one sequence and one of another."""
    parts = (info('a', 20, 40), info('a', 12, 40, corner=(0., 10.)), info('b', 30, 30))
    traces = (trace(parts[0], [1, .5, .5, .5] + [0] * 16), trace(parts[1], [1] * 12),
              trace(parts[2], [1] + [.2] * 29))
    return EvaluationRun('anchors', parts, {'one': traces})


def test_figures_of_all_starts_by_hand(run):
    (summary,) = summarize_anchors(run)
    figures = summary.all_starts
    assert (figures.starts, figures.failures) == (3, 1)
    # Before the failure and after the start: 3 frames of .5, 11 of 1 and 29 of .2.
    assert figures.accuracy.value == pytest.approx((3 * .5 + 11 + 29 * .2) / (3 + 11 + 29))
    # Sequence a survives 4 of 20 and 12 of 12 frames, b all; they weigh 40 and 30.
    assert figures.robustness.value == pytest.approx((40 * 16 / 32 + 30) / 70)
    # Of 21 thresholds .5 is above 10, .2 above 4 and 1 above 20.
    aucs = [(20 + 3 * 10) / 20 / 21, 20 / 21, (20 + 29 * 4) / 30 / 21]
    assert summary.aucs == pytest.approx(aucs)
    assert figures.success_auc.value == pytest.approx(np.mean(aucs))
    assert figures.success_auc.low <= figures.success_auc.value <= figures.success_auc.high


def test_entering_and_in_view_are_apart(run):
    (summary,) = summarize_anchors(run)
    assert (summary.entering.starts, summary.in_view.starts) == (1, 2)
    assert summary.entering.success_auc.value == pytest.approx(20 / 21)
    assert summary.entering.robustness.value == summary.entering.accuracy.value == 1
    assert summary.in_view.failures == 1
    assert summary.in_view.accuracy.value == pytest.approx((3 * .5 + 29 * .2) / 32)
    assert summary.in_view.robustness.value == pytest.approx((40 * 4 / 20 + 30) / 70)


def test_a_group_without_starts_has_no_figures(run):
    (summary,) = summarize_anchors(EvaluationRun('anchors', run.sequences[2:], {
        'one': run.traces['one'][2:]}))
    assert summary.entering.starts == 0
    assert math.isnan(summary.entering.success_auc.value)
    assert math.isnan(summary.entering.robustness.value)


def test_expected_overlap_by_hand(run):
    (summary,) = summarize_anchors(run)
    # N = 2: .5, 1 and .2. N = 12: the failed one has 3 of 11 frames. N = 20: the second part
    # has ended without a failure and says nothing. N = 30: the failed one goes on with 0.
    assert summary.curve[1] == pytest.approx((.5 + 1 + .2) / 3)
    assert summary.curve[11] == pytest.approx((1.5 / 11 + 1 + .2) / 3)
    assert summary.curve[19] == pytest.approx((1.5 / 19 + .2) / 2)
    assert summary.curve[29] == pytest.approx((1.5 / 29 + .2) / 2)
    assert anchor_interval(run) == (30, 30)
    assert summary.eao.value == pytest.approx((1.5 / 29 + .2) / 2)


def test_expected_overlap_is_the_mean_over_the_lengths_of_vot2020():
    part = info('long', 120, 120)
    falling = [1] + [.5] * 114 + [.9] * 5
    (summary,) = summarize_anchors(EvaluationRun('anchors', (part,), {
        'one': (trace(part, falling),)}))
    means = [(114 * .5 + n * .9) / (114 + n) for n in range(1, 6)]
    assert summary.eao.value == pytest.approx(np.mean(means))


def test_a_tracker_is_driven_backward(tmp_path, vot_folder, scripted):
    # Commands are in the images: it misses from frame 4 on, seen from either side.
    (sequence,) = scan_dataset(vot_folder(tmp_path / 'seq', [TRACK] * 4 + [MISS] * 20)).sequences
    parts = anchored_parts(sequence, AnchorPlan(spacing=14))
    traces = [PROTOCOLS['anchors'](resolve(scripted).build(), part) for part in parts]
    # Forward from 0: right in frames 1 to 3. Backward from 14: wrong down to 4, then right.
    assert traces[0].boxes[:5, 0].tolist() == [8, 9, 10, 11, 50]
    assert traces[1].boxes[[0, 1, 10, 11, 14], 0].tolist() == [22, 50, 50, 11, 8]
    infos = tuple(SequenceInfo(part.name, part.group, (64, 48), part.ground_truth, {},
                               origin=part.origin) for part in parts)
    (summary,) = summarize_anchors(EvaluationRun('anchors', infos, {'one': tuple(traces)}))
    # Of 24 frames 4 survive, of 15 only the start.
    assert summary.all_starts.failures == 2
    assert summary.all_starts.robustness.value == pytest.approx((4 + 1) / (24 + 15))
    assert summary.all_starts.accuracy.value == pytest.approx(1)


def test_a_refused_start_survives_nothing(tmp_path, vot_folder, scripted):
    (sequence,) = scan_dataset(vot_folder(tmp_path / 'seq', [REFUSE] + [TRACK] * 11)).sequences
    (part,) = anchored_parts(sequence, AnchorPlan())
    trace = PROTOCOLS['anchors'](resolve(scripted).build(), part)
    part_info = SequenceInfo(part.name, 'group', (64, 48), part.ground_truth, {},
                             origin=part.origin)
    (summary,) = summarize_anchors(EvaluationRun('anchors', (part_info,), {'one': (trace,)}))
    assert summary.all_starts.robustness.value == 0
    assert math.isnan(summary.all_starts.accuracy.value)
    assert 'refused to start' in summary.crashes[0]


def test_real_animals_enter_and_are_in_view(test_data):
    folder = test_data / 'thermal_ground'
    if not folder.is_dir():
        pytest.skip(f'there is no {folder}')
    found = scan_dataset(folder)
    assert not found.broken
    parts = [part for sequence in found.sequences
             for part in anchored_parts(sequence, AnchorPlan(50, 200))]
    assert len({part.origin for part in parts}) == len(found.sequences)
    entering = [bool(touches_border(part.ground_truth[:1], (160, 120))[0]) for part in parts]
    assert any(entering) and not all(entering)
