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
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.presence.comparison import Comparison
from lmsco_ros.core.weights.store import load_backbone

CENTER, SIZE = (80.3, 60.4), (24.0, 18.0)
BOX = BoundingBox.from_center(CENTER, SIZE)
COUNTS = IntensityRange(6900, 7600)


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene()


@pytest.fixture(scope='module')
def comparison(scene):
    """Return the comparison with the first frame of the scene."""
    view = FrameView(scene.frame(CENTER), COUNTS)
    return Comparison(load_backbone('comparison'), view, BOX)


def odds(comparison, image, box=BOX):
    """Return the log-odds that a box shows the target."""
    return comparison(FrameView(image, COUNTS), box)


def test_target_is_recognized_where_it_is(scene, comparison):
    for center, size in ((CENTER, SIZE), ((50.0, 90.0), SIZE), ((100.5, 40.2), (27.0, 20.0))):
        box = BoundingBox.from_center(center, size)
        assert odds(comparison, scene.frame(center, size), box) > 1


def test_background_is_not_taken_for_it(scene, comparison):
    assert odds(comparison, scene.frame()) < -1
    for place in ((40.0, 30.0), (120.0, 100.0), (120.0, 60.0)):
        assert odds(comparison, scene.frame(CENTER), BOX.moved_to(place)) < -1


def test_gain_and_offset_change_nothing(scene, comparison):
    image = scene.frame(CENTER).astype(np.float32)
    other = comparison(FrameView(3 * image + 100, IntensityRange(20800, 22900)), BOX)
    assert other == pytest.approx(odds(comparison, image), abs=1e-2)


class Network:
    """Encodes a patch as itself, and relates two by what they are."""

    context, size = 2.0, 16

    def encode(self, patch):
        return patch

    def reference(self, encoding):
        return 'reference', encoding

    def relate(self, reference, encoding):
        return reference, encoding


def test_region_of_the_first_box_is_related_to_that_of_another(scene):
    first = FrameView(scene.frame(CENTER), COUNTS)
    later, box = FrameView(scene.frame((90.0, 60.0)), COUNTS), BoundingBox(75, 52, 30, 12)
    (name, reference), encoding = Comparison(Network(), first, BOX)(later, box)
    assert name == 'reference'
    # Twice as wide and as high as the box, in the size of the network's patches.
    np.testing.assert_array_equal(reference, first.patch(BOX.scaled(2.0), (16, 16)))
    np.testing.assert_array_equal(encoding, later.patch(BoundingBox(60, 46, 60, 24), (16, 16)))
