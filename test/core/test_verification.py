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

"""The bundled comparison with the first frame, on scenes whose truth is known."""

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.backbones.weights import load_backbone
from lmsco_ros.core.intensity import IntensityRange
from lmsco_ros.core.sampling import FrameView
from lmsco_ros.core.verification import Verification

CENTER, SIZE = (80.3, 60.4), (24.0, 18.0)
BOX = BoundingBox.from_center(CENTER, SIZE)
COUNTS = IntensityRange(6900, 7600)


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene()


@pytest.fixture(scope='module')
def verification(scene):
    """Return the comparison with the first frame of the scene."""
    view = FrameView(scene.frame(CENTER), COUNTS)
    return Verification(load_backbone('verification'), view, BOX)


def odds(verification, image, box=BOX):
    """Return the log-odds that a box shows the target."""
    return verification(FrameView(image, COUNTS), box)


def test_target_is_recognized_where_it_is(scene, verification):
    for center, size in ((CENTER, SIZE), ((50.0, 90.0), SIZE), ((100.5, 40.2), (27.0, 20.0))):
        box = BoundingBox.from_center(center, size)
        assert odds(verification, scene.frame(center, size), box) > 1


def test_background_is_not_taken_for_it(scene, verification):
    assert odds(verification, scene.frame()) < -1
    for place in ((40.0, 30.0), (120.0, 100.0), (120.0, 60.0)):
        assert odds(verification, scene.frame(CENTER), BOX.moved_to(place)) < -1


def test_gain_and_offset_change_nothing(scene, verification):
    image = scene.frame(CENTER).astype(np.float32)
    other = verification(FrameView(3 * image + 100, IntensityRange(20800, 22900)), BOX)
    assert other == pytest.approx(odds(verification, image), abs=1e-2)
