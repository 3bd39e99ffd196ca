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

"""The table of the challenges, and the tracker that it is compared with."""

import numpy as np
import pytest

from benchmarks.challenge_table import challenge_table, insert
from benchmarks.plain_intensity import first_range, min_max
from lmsco_ros.core import BoundingBox, LMSCOTracker, track
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.run_file import SequenceInfo, write_run
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.whole_file import write_json


def evaluation(folder, challenge, lost, away=slice(10, 20)):
    """Write an evaluation of one sequence, with the target away in some frames."""
    truth = np.tile([10., 10., 8., 8.], (60, 1))
    boxes = truth.copy()
    truth[away] = np.nan
    states = np.zeros(60, bool)
    states[lost] = True
    trace = Trace(np.where(states[:, None], np.nan, boxes), np.full(60, 0.5), states, (0,),
                  updates=59, cpu_seconds=1.0, wall_seconds=1.0)
    folder.mkdir()
    write_json(folder / 'record.json', trace.to_json())
    sequence = SequenceInfo('one', 'group', (64, 48), truth, {}, challenge)
    write_run(folder, 'ope', (sequence,), {'default': ['record.json']}, {})
    return folder


def test_cases_stand_in_their_order_with_their_figures(tmp_path):
    late = evaluation(tmp_path / 'a', 'disappear_3s', slice(14, 22))
    soon = evaluation(tmp_path / 'b', '', slice(12, 20))
    rows = [line.strip('| ').split(' | ') for line in
            challenge_table([late, soon]).splitlines()[2:]]
    assert [row[0].split(':')[0] for row in rows] == ['as recorded', '`disappear_3s`']
    assert [row[5:] for row in rows] == [['1 of 1', '2', '.200', '1 of 1', '0'],
                                         ['1 of 1', '4', '.400', '1 of 1', '2']]


def test_start_on_nothing_has_no_accuracy(tmp_path):
    folder = evaluation(tmp_path / 'a', 'start_on_noise', slice(9, 60), away=slice(1, 60))
    row = challenge_table([folder]).splitlines()[2].strip('| ').split(' | ')
    assert row[3:] == ['–', '.00', '1 of 1', '8', '.136', '–', '–']


def test_folder_without_an_evaluation_is_named(tmp_path):
    with pytest.raises(DatasetError, match='empty'):
        challenge_table([tmp_path / 'empty'])


def test_table_takes_its_place_in_a_page():
    page = 'before\n<!-- cases -->\nold\n<!-- /cases -->\nafter\n'
    once = insert(page, 'cases', '| new |')
    assert once == 'before\n<!-- cases -->\n| new |\n<!-- /cases -->\nafter\n'
    assert insert(once, 'cases', '| new |') == once
    with pytest.raises(ValueError, match='<!-- other -->'):
        insert(page, 'other', '')


@pytest.mark.parametrize('make', [min_max, first_range])
def test_plain_trackers_follow_and_leave_the_core_as_it_is(make):
    """A warm square moves; as it steps further the polarity switches, which they do not know."""
    rng = np.random.default_rng(1)
    ground = rng.integers(60, 90, (96, 128)).astype(np.uint8)

    def frame(number, inverted=False):
        image = ground.copy()
        image[30:44, 30 + number:46 + number] = 200
        return 255 - image if inverted else image
    box = BoundingBox(30, 30, 16, 14)
    tracker = make()
    tracker.initialize(frame(0), box)
    assert track.AutomaticGain is AutomaticGain
    for number in range(1, 6):
        assert tracker.update(frame(number)).box.overlap(box.moved_to((38 + number, 37))) > 0.6
    whole = LMSCOTracker()
    whole.initialize(frame(0), box)
    for number in range(1, 6):
        whole.update(frame(number))
    there = box.moved_to((48, 37))
    plain, sure = (one.update(frame(10, inverted=True)).box.overlap(there)
                   for one in (tracker, whole))
    assert plain < sure - 0.03 and sure > 0.95
