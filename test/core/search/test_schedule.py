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
    schedule = Schedule(SearchConfig(tiles=tiles))
    seen = [place for _ in range(60 // min(tiles, 60) + 1)
            for place in schedule.tiles(SIZE, 80, (200, 50), 1)]
    count = 8 * 6
    distances = [np.hypot(x - 200, y - 50) for x, y in seen[:count]]
    assert len(set(seen)) == count and distances == sorted(distances)
    assert seen[count:] == seen[:len(seen) - count]
    xs, ys = np.array(seen[:count]).T
    assert min(xs) <= 40 and max(xs) >= 280 and min(ys) <= 40 and max(ys) >= 200


def test_restarted_search_starts_anew():
    schedule = Schedule(SearchConfig(tiles=4))
    first = schedule.tiles(SIZE, 80, (200, 50), 1)
    assert schedule.tiles(SIZE, 80, (200, 50), 1) != first
    schedule.restart()
    assert schedule.tiles(SIZE, 80, (200, 50), 1) == first
    assert Schedule(SearchConfig(tiles=0)).tiles(SIZE, 80, (200, 50), 1) == []


def test_salient_places_take_turns_while_it_hurries():
    schedule = Schedule(SearchConfig(candidates=4))
    assert schedule.candidates == 12
    assert [schedule.salient(misses) for misses in range(4)] == [
        range(0, 4), range(4, 8), range(8, 12), range(0, 4)]


def test_lost_target_is_looked_for_nearby_then_ahead_then_anywhere_and_in_slices_between():
    schedule = Schedule(SearchConfig())
    assert [schedule.turn(misses) for misses in range(6, 14)] == [
        Turn.NEAR, Turn.TILES, Turn.AHEAD, Turn.TILES, Turn.ANYWHERE, Turn.TILES,
        Turn.NEAR, Turn.TILES]


@pytest.mark.parametrize('candidates, count', [(4, 2), (5, 3), (1, 1), (0, 0)])
def test_half_of_the_salient_places_are_measured_and_all_get_their_turn(candidates, count):
    schedule = Schedule(SearchConfig(candidates=candidates))
    chosen = [schedule.measured(misses) for misses in range(4, 4 + 6 * 12, 6)]
    assert {len(places) for places in chosen} == {count}
    assert set().union(*chosen) >= set(range(schedule.candidates))
