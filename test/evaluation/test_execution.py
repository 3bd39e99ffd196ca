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

"""How a tracker is driven: once, and with new starts."""

import math

import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.execution import run_one_pass, run_supervised
from lmsco_ros.evaluation.trackers import resolve

TRACK, MISS, LOSE, RAISE, DIE, REFUSE = range(6)


@pytest.fixture
def run(tmp_path, vot_folder, scripted):
    """Return a function that runs the scripted tracker over commands."""
    def runner(protocol, commands, absent=()):
        folder = vot_folder(tmp_path / 'data' / 'seq', commands)
        rows = (folder / 'groundtruth.txt').read_text(encoding='utf-8').splitlines()
        rows = ['nan,nan,nan,nan' if index in absent else row for index, row in enumerate(rows)]
        (folder / 'groundtruth.txt').write_text('\n'.join(rows), encoding='utf-8')
        (sequence,) = scan_dataset(folder).sequences
        return protocol(resolve(scripted).build(), sequence)
    return runner


def test_one_pass_goes_on_after_a_miss(run):
    trace = run(run_one_pass, [TRACK, TRACK, MISS, LOSE, TRACK])
    assert trace.boxes[:, 0].tolist() == [8, 9, 50, 11, 12]
    assert trace.scores[1:].tolist() == [.75, .25, .75, .75] and math.isnan(trace.scores[0])
    assert trace.lost.tolist() == [False, False, False, True, False]
    assert (trace.starts, trace.failures, trace.updates, trace.error) == ((0,), (), 4, None)
    assert trace.wall_seconds > 0


def test_one_pass_starts_where_the_target_appears(run):
    trace = run(run_one_pass, [TRACK] * 5, absent=(0, 1))
    assert trace.starts == (2,)
    assert trace.updates == 2


def test_one_pass_keeps_what_came_before_a_crash(run):
    trace = run(run_one_pass, [TRACK, TRACK, RAISE, TRACK])
    assert trace.boxes[:2, 0].tolist() == [8, 9]
    assert math.isnan(trace.boxes[2, 0]) and math.isnan(trace.boxes[3, 0])
    assert trace.error == 'frame 2: RuntimeError: stumbled'


def test_one_pass_of_a_tracker_that_refuses_has_no_answers(run):
    trace = run(run_one_pass, [REFUSE, TRACK])
    assert math.isnan(trace.boxes[0, 0])
    assert 'refused to start' in trace.error


def test_supervised_starts_again_five_frames_after_a_failure(run):
    trace = run(run_supervised, [TRACK, TRACK, MISS] + [TRACK] * 8)
    assert (trace.starts, trace.failures) == ((0, 7), (2,))
    assert trace.boxes[7, 0] == 15
    assert math.isnan(trace.boxes[4, 0])


def test_supervised_waits_for_a_target_and_forgives_its_absence(run):
    trace = run(run_supervised, [TRACK, MISS, MISS] + [TRACK] * 9, absent=(1, 7))
    assert (trace.starts, trace.failures) == ((0, 8), (2,))


def test_supervised_counts_a_crash_and_a_refusal_as_failures(run):
    trace = run(run_supervised, [TRACK, RAISE] + [TRACK] * 4 + [REFUSE] + [TRACK] * 6)
    assert (trace.starts, trace.failures) == ((0, 6, 11), (1, 6))
    assert 'frame 1' in trace.error and 'frame 6' in trace.error


def test_supervised_ends_when_no_frame_is_left_to_start_on(run):
    trace = run(run_supervised, [TRACK, TRACK, MISS, TRACK, TRACK])
    assert (trace.starts, trace.failures) == ((0,), (2,))
