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

"""Where a target goes that is not seen."""

import numpy as np
import pytest

from lmsco_ros.core.search.prediction import Prediction
from lmsco_ros.core.types import BoundingBox

SIZE = (320, 240)
BOX = BoundingBox.from_center((100, 100), (20, 20))


def walk(prediction, step, count):
    """Let a target walk and return its last box."""
    for n in range(count):
        box = BOX.moved_to((100 + n * step[0], 100 + n * step[1]))
        prediction.seen(box.center)
    return box


def test_seen_target_is_expected_where_it_is():
    prediction = Prediction()
    box = walk(prediction, (3, -1), 20)
    assert prediction.expected(box, SIZE) == box


def test_missed_target_goes_on_and_comes_to_rest():
    prediction = Prediction()
    box = walk(prediction, (3, -1), 20)
    ways = []
    for _ in range(40):
        prediction.missed()
        ways.append(prediction.expected(box, SIZE).center[0] - box.center[0])
    assert ways[0] == pytest.approx(3, rel=0.01)
    assert np.all(np.diff(ways) >= 0) and np.diff(ways)[-1] < 1e-3
    assert ways[-1] == pytest.approx(3 / 0.3, rel=0.01)


def test_target_in_the_place_of_another_one_goes_on_as_before():
    prediction = Prediction()
    box = walk(prediction, (3, -1), 20)
    before = prediction.velocity
    for _ in range(5):
        prediction.seen(box.center, merged=True)
    assert prediction.velocity == before and prediction.misses == 0
    # Alone again, it is where it is: the way there is one frame's.
    prediction.seen((box.center[0] + 13, box.center[1] - 1))
    assert prediction.velocity[0] == pytest.approx(before[0] + 0.3 * (13 - before[0]))


def test_found_target_has_no_motion_of_before_wherever_it_is():
    for merged in (False, True):
        prediction = Prediction()
        box = walk(prediction, (3, -1), 20)
        prediction.missed()
        prediction.seen(box.center, merged)
        assert prediction.velocity == (0.0, 0.0) and prediction.misses == 0


def test_stopped_target_does_not_go_on():
    prediction = Prediction()
    box = walk(prediction, (3, -1), 20)
    prediction.missed()
    prediction.stop()
    assert prediction.expected(box, SIZE) == box


def test_misses_are_counted_from_the_last_sight():
    prediction = Prediction()
    counts = []
    for seen in (True, False, False, True, False):
        prediction.seen(BOX.center) if seen else prediction.missed()
        counts.append(prediction.misses)
    assert counts == [0, 1, 2, 0, 1]


def test_expected_center_stays_in_the_image():
    prediction = Prediction()
    box = walk(prediction, (20, 0), 11)
    for _ in range(10):
        prediction.missed()
        assert prediction.expected(box, SIZE).center[0] <= SIZE[0]


def after_misses(*centers, misses=1):
    """Return how far ahead a target is expected that was seen at some places, then missed."""
    prediction = Prediction()
    for center in centers:
        prediction.seen(center)
    for _ in range(misses):
        prediction.missed()
    box = BOX.moved_to(centers[-1])
    return np.subtract(prediction.expected(box, SIZE).center, box.center)


def test_new_target_was_never_missed():
    assert Prediction().misses == 0


def test_target_that_was_seen_once_stays():
    assert after_misses((100, 100)) == pytest.approx((0, 0), abs=1e-12)


def test_velocity_is_the_mean_of_the_steps_that_forgets():
    assert after_misses((100, 100), (110, 80)) == pytest.approx((3, -6))
    # Three tenths of the second step, and of the rest what was before it.
    assert after_misses((100, 100), (110, 80), (110, 90)) == pytest.approx((2.1, -4.2 + 3))


def test_velocity_fades_by_three_tenths_a_frame():
    ahead = [after_misses((100, 100), (110, 80), misses=n)[0] for n in range(4)]
    assert ahead == pytest.approx([0, 3, 3 * 1.7, 3 * (1 + 0.7 + 0.49)])


def test_target_that_was_seen_again_begins_to_move_anew():
    """The way that it took in the meantime says nothing of a frame."""
    prediction = Prediction()
    walk(prediction, (3, -1), 20)
    prediction.missed()
    prediction.seen((130, 90))
    prediction.missed()
    back = BOX.moved_to((130, 90))
    assert prediction.expected(back, SIZE).center == pytest.approx(back.center, abs=1e-12)
    prediction.seen((130, 90))
    prediction.seen((140, 80))
    prediction.missed()
    there = BOX.moved_to((140, 80))
    assert prediction.expected(there, SIZE).center == pytest.approx((143, 77))


@pytest.mark.parametrize('step, border', [((-20, 0), (0, 100)), ((0, -20), (100, 0)),
                                          ((30, 0), (320, 100)), ((0, 30), (100, 240))])
def test_target_is_expected_at_the_border_at_most(step, border):
    prediction, center = Prediction(), (100, 100)
    while 0 <= center[0] <= SIZE[0] and 0 <= center[1] <= SIZE[1]:
        prediction.seen(center)
        last, center = center, (center[0] + step[0], center[1] + step[1])
    for _ in range(10):
        prediction.missed()
    assert prediction.expected(BOX.moved_to(last), SIZE).center == border
