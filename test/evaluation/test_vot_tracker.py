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

"""The tracker as the VOT toolkit calls it in Python, without the toolkit."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, BoxError, ImageError, LMSCOTracker
from lmsco_ros.evaluation.vot_tracker import Tracker

BOX = (15.0, 40.0, 10.0, 8.0)


@pytest.fixture
def files(tmp_path, sequence):
    """Return the files of three images of a target at `BOX`."""
    images = sequence(3).frames
    paths = [str(tmp_path / f'{index}.png') for index in range(3)]
    for index, path in enumerate(paths):
        cv2.imwrite(path, images[index])
    return paths


@pytest.fixture
def expected(files):
    """Return what the library says of these images."""
    tracker = LMSCOTracker('hcs')
    tracker.initialize(cv2.imread(files[0], cv2.IMREAD_GRAYSCALE), BoundingBox(*BOX))
    result = tracker.update(cv2.imread(files[1], cv2.IMREAD_GRAYSCALE))
    return result.box.as_tuple(), {'confidence': result.score, 'state': result.state.value}


CORNERS = [(15.0, 40.0), (25.0, 40.0), (25.0, 48.0), (15.0, 48.0)]


@pytest.mark.parametrize('region', [BOX, CORNERS], ids=['rectangle', 'polygon'])
def test_answers_are_those_of_the_library(files, expected, region):
    tracker = Tracker('hcs')
    for _ in range(2):
        assert tracker.init(files[0], (region, {}), {})[0] == BOX
        assert tracker.update(files[1], [], {}) == expected


def test_thermal_channel_is_taken_of_several(files, expected):
    tracker = Tracker('hcs')
    tracker.init({'color': 'no such file', 'ir': files[0]}, (BOX, {}), {})
    assert tracker.update({'color': 'no such file', 'ir': files[1]}, [], {}) == expected


def test_what_cannot_be_used_is_told(files):
    tracker = Tracker('hcs')
    with pytest.raises(BoxError, match='set `convert = rectangle`'):
        tracker.init(files[0], (np.ones((4, 4)), {}), {})
    with pytest.raises(ImageError, match='missing.png'):
        tracker.init('missing.png', (BOX, {}), {})
