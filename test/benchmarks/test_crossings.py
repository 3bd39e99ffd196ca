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

"""Two targets cross: who is on whom is counted, and one tracker for both keeps more ids."""

import numpy as np
import pytest

from benchmarks import crossings
from benchmarks.crossings import (
    count, Crossing, crossing_table, recorded_crossing, rendered_crossing, Tally)
from lmsco_ros.core import BoundingBox, TrackerConfig
from lmsco_ros.evaluation.datasets import TrackingSequence

LEFT, MIDDLE, RIGHT = ((x, 10.0, 20.0, 20.0) for x in (10.0, 40.0, 70.0))


class Frames(list):
    """Images in memory."""

    signature = 'memory'


def box(values):
    """Return the box of four numbers, None for none."""
    return None if values is None else BoundingBox(*values)


def tally(first, second, truth=((LEFT, RIGHT), (MIDDLE, MIDDLE), (RIGHT, LEFT))):
    """Return what became of two targets with these boxes in three frames."""
    told = Tally()
    told.add(([box(one), box(two)] for one, two in zip(first, second)), np.array(truth))
    return told


@pytest.mark.parametrize('first, second, expected', [
    ((LEFT, MIDDLE, RIGHT), (RIGHT, MIDDLE, LEFT), (0, 2, 0, 0)),
    # Both turn around in the middle, where they cannot be told apart.
    ((LEFT, MIDDLE, LEFT), (RIGHT, MIDDLE, RIGHT), (2, 0, 2, 0)),
    # Both go on with the first one.
    ((LEFT, MIDDLE, RIGHT), (RIGHT, MIDDLE, RIGHT), (1, 1, 1, 0)),
    ((LEFT, None, RIGHT), (RIGHT, MIDDLE, None), (0, 1, 0, 1)),
    # On nothing.
    ((LEFT, MIDDLE, (40.0, 60.0, 20.0, 20.0)), (RIGHT, MIDDLE, LEFT), (0, 1, 0, 1))])
def test_switches_and_ends_are_counted(first, second, expected):
    told = tally(first, second)
    assert (told.switches, told.own, told.other, told.lost) == expected and told.pairs == 1


def test_frame_in_which_one_is_absent_tells_nothing():
    nowhere = (np.nan,) * 4
    told = tally((LEFT, LEFT, LEFT), (RIGHT, RIGHT, RIGHT),
                 ((LEFT, RIGHT), (LEFT, nowhere), (nowhere, RIGHT)))
    assert (told.switches, told.own, told.other, told.lost) == (0, 0, 0, 2)


@pytest.mark.parametrize('seed', range(3))
def test_rendered_persons_pass_each_other(seed):
    made = rendered_crossing(seed)
    assert made.truth.shape == (len(made.frames), 2, 4)
    apart = made.truth[:, 0, 0] - made.truth[:, 1, 0]
    assert apart[0] < -20 and apart[-1] > 20
    size = made.frames[0].shape[::-1]
    assert (made.truth[..., :2] >= 0).all()
    assert (made.truth[..., :2] + made.truth[..., 2:] <= size).all()
    # Both are warmer than what is around them.
    for x, y, width, height in made.truth[0]:
        middle = made.frames[0][int(y + height / 3), int(x + width / 2)]
        assert middle > np.median(made.frames[0]) + 100


def still(target, frames=150):
    """Return a sequence of a warm square that stands still."""
    image = np.random.default_rng(0).normal(100, 3, (160, 200))
    x, y, width, height = map(int, target)
    image[y:y + height, x:x + width] = 220
    return TrackingSequence('still', 'made', Frames([image.astype(np.uint8)] * frames),
                            np.tile(np.array(target, float), (frames, 1)))


def test_copy_that_crosses_a_recorded_target_has_its_box():
    made = recorded_crossing(still((90, 70, 12, 12)))
    assert (made.truth[:, 0] == (90, 70, 12, 12)).all()
    ways = made.truth[:, 1, :2] - made.truth[:, 0, :2]
    assert np.linalg.norm(ways[0]) > 18 and ways[0] @ ways[-1] < 0
    for image, truth in zip(made.frames[::9], made.truth[::9]):
        for x, y, width, height in truth:
            assert image[int(y + height / 2), int(x + width / 2)] > 180


@pytest.mark.parametrize('target', [(90, 70, 110, 80), (1, 70, 12, 12)])
def test_recording_without_room_for_both_is_left_out(target):
    made = recorded_crossing(still(target))
    assert made is None or np.linalg.norm(np.diff(made.truth[0, :, :2], axis=0)) >= 18


def test_one_tracker_for_both_keeps_more_numbers_than_one_for_each(tmp_path):
    tallies = count(TrackerConfig.preset('default'), map(rendered_crossing, range(4)))
    kind = 'two persons, rendered'
    both, each = tallies[kind, 'one for both'], tallies[kind, 'one for each']
    assert both.pairs == each.pairs == 4 and both.own + both.other + both.lost == 8
    assert both.switches < each.switches and both.own > each.own
    # Two who cover each other are uncertain, and still known to each other.
    assert both.switches == 0 and both.own == 8
    table = crossing_table(tallies).splitlines()
    assert len(table) == 4 and table[2].split(' | ')[2] == 'one for both'


def test_table_goes_into_the_page(monkeypatch, tmp_path):
    follow = {'stays': lambda config, crossing: [crossing.starts] * (len(crossing.truth) - 1)}
    monkeypatch.setattr(crossings, 'FOLLOW', follow)
    monkeypatch.setattr(crossings, 'rendered_crossing', lambda seed: Crossing(
        'made', [None] * 3, np.array([(LEFT, RIGHT), (MIDDLE, MIDDLE), (RIGHT, LEFT)])))
    page = tmp_path / 'page.md'
    page.write_text('<!-- crossings -->\nold\n<!-- /crossings -->\n')
    crossings.main(['--scenes', '3', '--page', str(page)])
    assert '| made | 3 | stays | 0 | 0 | 6 | 0 |' in page.read_text()
