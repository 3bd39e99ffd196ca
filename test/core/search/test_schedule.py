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

"""In which order an image is searched."""

import numpy as np
import pytest

from lmsco_ros.core.config import SearchConfig
from lmsco_ros.core.search.schedule import Schedule, Turn

SIZE = (320, 240)


@pytest.mark.parametrize('tiles', [1, 3, 64])
def test_slices_cover_the_image_from_the_inside_out_and_start_over(tiles):
    schedule = Schedule(SearchConfig())
    seen = [place for _ in range(60 // min(tiles, 60) + 1)
            for place in schedule.tiles(SIZE, 80, (200, 50), tiles)]
    count = 8 * 6
    distances = [np.hypot(x - 200, y - 50) for x, y in seen[:count]]
    assert len(set(seen)) == count and distances == sorted(distances)
    assert seen[count:] == seen[:len(seen) - count]
    xs, ys = np.array(seen[:count]).T
    assert min(xs) <= 40 and max(xs) >= 280 and min(ys) <= 40 and max(ys) >= 200


def test_restarted_search_starts_anew():
    schedule = Schedule(SearchConfig(tiles=4))
    first = schedule.tiles(SIZE, 80, (200, 50), 4)
    assert schedule.tiles(SIZE, 80, (200, 50), 4) != first
    schedule.restart()
    assert schedule.tiles(SIZE, 80, (200, 50), 4) == first
    assert schedule.tiles(SIZE, 80, (200, 50), 0) == []


def test_salient_places_take_turns_while_it_hurries():
    schedule = Schedule(SearchConfig(candidates=4))
    assert schedule.candidates == 12
    assert [schedule.salient(misses) for misses in range(4)] == [
        range(0, 4), range(4, 8), range(8, 12), range(0, 4)]


def test_lost_target_is_looked_for_everywhere_in_turns():
    schedule = Schedule(SearchConfig())
    assert [schedule.turn(misses) for misses in range(8, 18)] == [
        Turn.NEAR, Turn.SALIENT, Turn.TILES, Turn.ANYWHERE,
        Turn.AHEAD, Turn.SALIENT, Turn.TILES, Turn.ANYWHERE, Turn.NEAR, Turn.SALIENT]


@pytest.mark.parametrize('candidates, count', [(1, 1), (4, 2), (5, 3), (64, 32)])
@pytest.mark.parametrize('turn', [Turn.NEAR, Turn.AHEAD, Turn.SALIENT, Turn.ANYWHERE])
@pytest.mark.parametrize('places', [1, 7, 12, 48])
def test_all_salient_places_are_measured_before_any_again(candidates, count, turn, places):
    schedule = Schedule(SearchConfig(candidates=candidates))
    chosen = [schedule.measured(misses, places) for misses in range(5, 4000)
              if schedule.turn(misses) is turn]
    rounds = -(-places // count)
    assert max(map(len, chosen)) == min(count, places)
    for first in range(5):
        measured = [place for part in chosen[first:first + rounds] for place in part]
        assert sorted(measured) == list(range(places))


def test_within_a_second_the_most_salient_places_are_measured():
    schedule = Schedule(SearchConfig())
    measured = [place for misses in range(5, 29) if schedule.turn(misses) is Turn.SALIENT
                for place in schedule.measured(misses, schedule.candidates)]
    assert sorted(measured) == list(range(12))


@pytest.mark.parametrize('candidates, places', [(0, 48), (4, 0), (0, 0)])
def test_nothing_is_measured_where_there_is_nothing_to_measure(candidates, places):
    schedule = Schedule(SearchConfig(candidates=candidates))
    assert not any(schedule.measured(misses, places) for misses in range(20))
