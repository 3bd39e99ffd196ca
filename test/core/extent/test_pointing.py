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

"""What is found at a point: the thing that stands out there, or why nothing was found."""

import numpy as np
import pytest

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.errors import PointError
from lmsco_ros.core.extent.pointing import extent_at
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.core.weights.store import load_backbone
from lmsco_ros.synthetic import render_scene, SceneConfig


@pytest.fixture(scope='module')
def network():
    """Return the bundled network."""
    return load_backbone('extent', None)


def view(boxes, warmer=60.0, noise=2.0):
    """Return a frame with an ellipse in each box."""
    x, y = np.meshgrid(np.arange(200) + 0.5, np.arange(160) + 0.5)
    image = 110 + noise * np.random.default_rng(5).normal(size=x.shape)
    for box in boxes:
        away = np.hypot((x - box.center[0]) / box.width, (y - box.center[1]) / box.height)
        image += warmer / (1 + np.exp(30 * (away - 0.5)))
    image = np.clip(image, 0, 255).astype(np.uint8)
    return FrameView(image, AutomaticGain(IntensityConfig()).observe(image))


@pytest.mark.parametrize('warmer', [60.0, -60.0])
@pytest.mark.parametrize('size', [(12.0, 12.0), (30.0, 20.0), (24.0, 60.0), (90.0, 70.0)])
def test_extent_of_what_stands_out_is_found(network, size, warmer):
    box = BoundingBox.from_center((96, 78), size)
    found = extent_at(network, view([box], warmer), (98, 80))
    assert found.overlap(box) > 0.6


@pytest.mark.parametrize('seed', range(3))
def test_whole_walker_is_found(network, seed):
    scene = SceneConfig(width=320, height=256, frames=1, clutter=15, seed=seed)
    image, box = next((frame.image, frame.box) for frame in render_scene(scene))
    shown = FrameView(image, AutomaticGain(IntensityConfig()).observe(image))
    assert extent_at(network, shown, box.center).overlap(box) > 0.5


def test_of_two_things_the_one_at_the_point_is_found(network):
    boxes = [BoundingBox(50, 60, 20, 20), BoundingBox(110, 60, 20, 30)]
    for box in boxes:
        assert extent_at(network, view(boxes), box.center).overlap(box) > 0.6


def test_box_stays_in_the_image(network):
    found = extent_at(network, view([BoundingBox(-15, 60, 40, 30)]), (8, 75))
    assert found.x >= 0 and found.overlap(BoundingBox(0, 60, 25, 30)) > 0.6


@pytest.mark.parametrize('point', [(40, 40), (150, 120)])
def test_noise_is_nothing(network, point):
    with pytest.raises(PointError, match=r'nothing stands out .* warmer or colder'):
        extent_at(network, view([], noise=8.0), point)


class FakeNetwork:
    """Answers by the side of the square that it is asked about, and keeps these sides."""

    size, context, nothing = 8, 3.0, None

    def __init__(self, answer):
        self.answer, self.sides = answer, []

    def reference(self, encoding):
        """Return nothing, since nothing was marked."""
        return encoding

    def answers(self, questions):
        """Return the answer to each question."""
        asked = [2**side for _, _, (_, side) in questions]
        self.sides += asked
        return [self.answer(side) for side in asked]


def answer(presence=1.0, deviation=1e-3, right=0.0):
    """Return that the square is right, or lies so many halves of the patch further right."""
    return np.array([right, 0, right, 0, *np.log(np.full(4, deviation)), presence])


def test_squares_grow_to_a_part_of_the_longer_side_of_the_image():
    network = FakeNetwork(lambda side: answer())
    extent_at(network, view([]), (100, 80))
    # Up to 0.7 * 200; each is measured, and three times more where it was measured.
    assert sorted(network.sides) == pytest.approx(
        [8 * 2**(n / 2) for n in range(9) for _ in range(4)])


def test_what_is_sure_is_taken_before_what_is_a_little_more_present():
    # Three log-odds, less ten for 1.5 * sqrt(2) * 0.2 = 0.42 of the side.
    network = FakeNetwork(lambda side: answer(3.0, 0.2) if side < 20 else answer())
    assert extent_at(network, view([]), (100, 80)).size == pytest.approx(2 * (8 * 2**1.5,))


def test_what_does_not_hold_the_point_is_not_taken_however_present():
    network = FakeNetwork(lambda side: answer(9.0, right=1.0) if side < 10 else answer())
    found = extent_at(network, view([]), (60, 60))
    assert found.center == pytest.approx((60, 60)) and found.width > 10


@pytest.mark.parametrize('point', [(0, 0), (200, 160)])
def test_corner_is_in_the_image(point):
    found = extent_at(FakeNetwork(lambda side: answer()), view([]), point)
    assert found.contains(point) and found.size == pytest.approx((4, 4))


@pytest.mark.parametrize('point', [(1, 2, 3), 'ab', None, 7, ('a', 'b'), (10**400, 1)])
def test_what_is_no_point_is_refused(network, point):
    with pytest.raises(PointError, match=r'expected \(x, y\): two numbers'):
        extent_at(network, view([]), point)


@pytest.mark.parametrize('point', [(np.nan, 5), (-1, 5), (201, 5), (5, 161)])
def test_point_outside_is_refused(network, point):
    with pytest.raises(PointError, match='not in the image of 200 x 160 pixels'):
        extent_at(network, view([]), point)
