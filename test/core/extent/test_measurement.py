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

"""The measurement: what the network is shown, and what is made of its answer."""

import math

import numpy as np
import pytest
import torch

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.extent.measurement import ExtentMeter, Measurement
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.core.weights.store import load_backbone

BOX = BoundingBox(60.0, 50.0, 40.0, 24.0)


class FakeNetwork:
    """Keeps what it is shown, and answers what it is told to."""

    size, context = 64, 3.0

    def __init__(self, answer=np.zeros(9)):
        self.answer, self.shown, self.sides = np.asarray(answer, float), [], None

    def encode(self, patch):
        """Return the patch itself."""
        self.shown.append(patch)
        return patch

    def reference(self, encoding):
        """Return a name for it."""
        return 'first', encoding

    def answers(self, questions):
        """Return the answer to each question."""
        for patch, reference, sides in questions:
            assert reference[0] == 'first' and reference[1] is self.shown[0]
            self.shown.append(patch)
            self.sides = sides
        return [self.answer] * len(questions)


def view(image):
    """Return an image in the range of a fresh gain."""
    return FrameView(image, AutomaticGain(IntensityConfig()).observe(image))


@pytest.fixture
def frame(rng):
    """Return a frame of noise."""
    return view(rng.integers(0, 255, (128, 160)).astype(np.uint8))


def test_zeros_mean_the_expected_box(frame):
    meter = ExtentMeter.marked(FakeNetwork(), frame, BOX)
    measured = meter(frame, BOX.moved_to((70, 60)))
    assert measured.box.as_tuple() == pytest.approx(BOX.moved_to((70, 60)).as_tuple())
    assert measured.deviations == pytest.approx(
        np.full((2, 2), math.sqrt(2) * 1.5 * BOX.area**0.5))
    assert measured.presence == 0


def test_answers_are_edges_in_halves_of_the_patch(frame):
    answer = [-0.1, 0.2, 0.3, 0.4, *np.log([0.1, 0.2, 0.3, 0.4]), 2.5]
    measured = ExtentMeter.marked(FakeNetwork(answer), frame, BOX)(frame, BOX)
    half = 1.5 * BOX.area**0.5
    assert measured.edges == pytest.approx(np.array(
        [[60 - 0.1 * half, 100 + 0.3 * half], [50 + 0.2 * half, 74 + 0.4 * half]]))
    assert measured.deviations == pytest.approx(
        math.sqrt(2) * half * np.array([[0.1, 0.3], [0.2, 0.4]]))
    assert measured.presence == 2.5


def test_crossed_edges_are_put_in_order(frame):
    measured = ExtentMeter.marked(FakeNetwork([2, 0, -2, 0, *np.zeros(5)]), frame, BOX)(frame, BOX)
    assert (measured.edges[:, 1] >= measured.edges[:, 0]).all()
    assert min(measured.box.size) >= 0


def measured_edges(frame, edges):
    """Return the edges that are made of those that the network tells."""
    half = 1.5 * BOX.area**0.5
    told = (np.array(edges) - [[60, 100], [50, 74]]).T.ravel() / half
    network = FakeNetwork([*told, *np.zeros(5)])
    return ExtentMeter.marked(network, frame, BOX)(frame, BOX).edges


def test_crossed_edges_change_their_places(frame):
    edges = measured_edges(frame, [[100, 60], [50, 74]])
    np.testing.assert_allclose(edges, [[60, 100], [50, 74]])


def test_edges_at_the_same_place_leave_one_pixel_between_them(frame):
    edges = measured_edges(frame, [[80, 80], [62.25, 61.75]])
    np.testing.assert_allclose(edges, [[79.5, 80.5], [61.5, 62.5]])


def test_network_knows_the_sizes_of_both_boxes(frame):
    network = FakeNetwork()
    ExtentMeter.marked(network, frame, BOX)(frame, BOX.scaled(2.0))
    side = math.log2(BOX.area) / 2
    assert network.sides == pytest.approx((side, side + 1))


def test_patch_shows_the_box_and_the_image(frame):
    network = FakeNetwork()
    box = BoundingBox(0.0, 30.0, 20.0, 20.0)
    ExtentMeter.marked(network, frame, box)
    intensity, inside, image = network.shown[0]
    # The patch covers x from -20 to 40 and y from 10 to 70, 60 pixels in 64.
    assert inside.sum() / 64**2 == pytest.approx(1 / 9, rel=1e-3)
    columns = np.flatnonzero(inside.sum(axis=0) > 0)
    assert (columns[0], columns[-1]) == (21, 42)
    assert image.sum() / 64**2 == pytest.approx(2 / 3, rel=1e-3)
    assert not image[:, :21].any() and image[:, 22:].all()
    region = BoundingBox(-20, 10, 60, 60)
    assert intensity == pytest.approx(frame.patch(region, (64, 64)))


def scene(box, gain=1.0, noise=0.0, seed=3):
    """Return a frame with an ellipse that fills a box."""
    x, y = np.meshgrid(np.arange(160) + 0.5, np.arange(128) + 0.5)
    away = np.hypot((x - box.center[0]) / box.width, (y - box.center[1]) / box.height)
    image = 100 + 80 * gain / (1 + np.exp(30 * (away - 0.5)))
    image += noise * np.random.default_rng(seed).normal(size=image.shape)
    return view(np.clip(image, 0, 255).astype(np.uint8))


@pytest.fixture(scope='module')
def network():
    """Return the bundled network."""
    torch.set_num_threads(1)
    return load_backbone('extent', None)


@pytest.mark.parametrize('gain', [1.0, -1.0], ids=['warm', 'cold'])
@pytest.mark.parametrize('grown', [(1.0, 1.0), (1.5, 1.4), (0.7, 1.0), (1.0, 1.6)])
def test_bundled_network_measures_an_ellipse(network, gain, grown):
    first, wide, high = BoundingBox.from_center((80, 64), (36.0, 24.0)), *grown
    now = BoundingBox.from_center((83, 62), (36.0 * wide, 24.0 * high))
    meter = ExtentMeter.marked(network, scene(first, gain), first)
    measured = meter(scene(now, gain), first.moved_to((81, 63)))
    assert measured.box.overlap(now) > 0.85
    assert measured.presence > 1


def test_bundled_network_follows_the_border(network):
    whole = BoundingBox.from_center((6, 64), (44.0, 30.0))
    part = BoundingBox(0, whole.y, 28.0, 30.0)
    meter = ExtentMeter.marked(network, scene(whole), part)
    inside = BoundingBox.from_center((40, 64), (44.0, 30.0))
    box = part.moved_to((36, 64))
    for _ in range(3):
        box = meter(scene(inside), box).box
    assert box.overlap(inside) > 0.85


def test_bundled_network_is_less_sure_of_what_it_can_hardly_see(network):
    box = BoundingBox.from_center((80, 64), (16.0, 12.0))
    meter = ExtentMeter.marked(network, scene(box), box)
    clear, noisy = (meter(scene(box, gain, noise), box)
                    for gain, noise in ((1.0, 1.0), (0.15, 12.0)))
    assert noisy.deviations.mean() > 1.5 * clear.deviations.mean()
    assert meter(scene(box, 0.0, 4.0), box).presence < 0 < clear.presence


def test_measurement_is_a_box():
    measured = Measurement(np.array([[1.0, 5.0], [2.0, 9.0]]), np.ones((2, 2)), 0.0)
    assert measured.box == BoundingBox(1, 2, 4, 7)
