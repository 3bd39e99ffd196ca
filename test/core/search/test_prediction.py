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
