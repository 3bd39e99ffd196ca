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

"""Two checkouts take turns; their times are compared stage by stage."""

from pathlib import Path

import pytest

from benchmarks import before_after
from benchmarks.profiling import FrameProfile, REST
from benchmarks.scenes import moving_scene
from benchmarks.stages import TRAINING

REPOSITORY = Path(before_after.__file__).parents[1]


def test_checkout_beside_itself(capsys):
    """Both see all frames, and every line of the table has a ratio."""
    before_after.main(['--before', str(REPOSITORY), '--frames', '4', '--target', '20'])
    printed = capsys.readouterr().out
    assert 'vehicle of 20 pixels, 4 frames' in printed
    update = next(line for line in printed.splitlines() if '**update**' in line)
    before, after, ratio = (float(cell) for cell in update.split('|')[2:5])
    assert before > 0 and ratio == pytest.approx(after / before, rel=0.02)


def test_frames_of_a_checkout_hold_their_stages():
    """The frame behind every other one begins with training; stages add up to the whole."""
    frames, = before_after.measure([REPOSITORY], 'default', moving_scene((320, 256), 30, 6))
    assert [frame.trained for frame in frames] == [False, False, True, False, True]
    for frame in frames:
        assert sum(frame.stages.values()) == pytest.approx(frame.total)


def test_folder_without_a_core_is_an_error(tmp_path, capfd):
    """Python says that there is no such program, and its end does not go unnoticed."""
    with pytest.raises(RuntimeError, match='ended with status 2'):
        before_after.measure([tmp_path], 'default', moving_scene((320, 256), 30, 3))


def test_ratios_are_those_of_averages():
    """A stage of training alone counts as often as it occurs; a new one has no ratio."""
    before = [FrameProfile(4.0, {'peak': 2.0, REST: 2.0}, {}, False),
              FrameProfile(10.0, {'peak': 2.0, TRAINING: 6.0, REST: 2.0}, {}, True)]
    after = [FrameProfile(3.0, {'peak': 1.0, REST: 2.0}, {}, False),
             FrameProfile(7.0, {'peak': 1.0, TRAINING: 3.0, 'new': 1.0, REST: 2.0}, {}, True)]
    lines = before_after.ratio_table(before, after).splitlines()[2:]
    cells = {line.split('|')[1].strip(): line.split('|')[2:5] for line in lines}
    ratios = {name: row[2].strip() for name, row in cells.items()}
    assert ratios == {TRAINING: '0.500', 'peak': '0.500', 'new': '–', REST: '1.00',
                      '**update**': '0.714'}
