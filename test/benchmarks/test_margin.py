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

"""The losses that are compared: desired scores, margins, and what is put back in its place."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.margin import (
    compare_losses, Contender, CONTENDERS, falling_label, margin, margin_table, overlap_label)
from lmsco_ros.core import BoundingBox, TrackResult, TrackState
from lmsco_ros.core.learning import structured_operator
from lmsco_ros.core.learning.margin import gaussian_label
from lmsco_ros.evaluation.datasets import TrackingSequence

# A target of 1/4 by 1/5 of the region.
SIGMA = (0.25 / 12, 0.2 / 12)


def test_overlap_is_that_of_the_target_with_itself_at_each_shift():
    label = overlap_label(20, SIGMA)
    target = BoundingBox(0, 0, 0.2, 0.25)
    assert label[0, 0] == 1
    for row, column in ((1, 0), (3, 2), (19, 1), (18, 17), (10, 10)):
        shifted = BoundingBox(((column + 10) % 20 - 10) / 20, ((row + 10) % 20 - 10) / 20,
                              0.2, 0.25)
        assert label[row, column] == pytest.approx(target.overlap(shifted), abs=1e-12)


def test_growing_loss_goes_on_where_the_gaussian_has_ended():
    label, gaussian = falling_label(21, SIGMA), gaussian_label(21, SIGMA)
    assert label[0, 0] == 1
    # A quarter for each side of the target: 8 of 21 rows are 1.52 of them.
    assert label[8, 0] - gaussian[8, 0] == pytest.approx(-0.25 * 8 / 21 / 0.25)
    assert label[0, 21 - 8] - gaussian[0, 8] == pytest.approx(-0.25 * 8 / 21 / 0.2)
    assert label[10, 10] < label[5, 5] < label[2, 2]


def told(scores, box=BoundingBox(40, 40, 20, 20)):
    """Return a result with a map over a region of 100 pixels."""
    return TrackResult(box, 0.9, TrackState.TRACKING, np.array(scores, np.float32),
                       BoundingBox(0, 0, 100, 100))


def test_margin_is_over_what_is_half_a_target_away():
    scores = np.zeros((21, 21))
    scores[10, 10], scores[10, 12], scores[13, 10], scores[0, 0] = 0.8, 0.7, 0.2, 0.1
    # Half of the target is 2.1 points: the neighbor at 2 belongs to it.
    assert margin(told(scores)) == pytest.approx(1 - 0.2 / 0.8)
    scores[10, 13] = 0.4
    assert margin(told(scores)) == pytest.approx(0.5)
    wide = BoundingBox(40, 40, 30, 20)
    assert margin(told(scores, wide)) == pytest.approx(1 - 0.2 / 0.8)
    # The map is periodic.
    corner = np.zeros((21, 21))
    corner[0, 0], corner[20, 19], corner[10, 10] = 1, 0.9, 0.3
    assert margin(told(corner)) == pytest.approx(0.7)


def test_table_has_the_median_of_each_fifth():
    frames = [[0.1] * 4 + [0.2] * 4 + [0.3] * 4 + [0.4] * 4 + [0.5, 0.5, 0.5, -80.0]]
    row = margin_table({'one': frames}).splitlines()[2]
    assert row == '| one | 0.100 | 0.200 | 0.300 | 0.400 | 0.500 |'


class Walk:
    """A warm square that moves to the right over uneven ground."""

    signature = 'walk'

    def __len__(self):
        return 12

    def __getitem__(self, index):
        ground = np.random.default_rng(4).integers(40, 90, (96, 128)).astype(np.uint8)
        image = cv2.GaussianBlur(ground, (0, 0), 1)
        image[30:44, 40 + index:56 + index] = 200
        return image


def test_every_loss_follows_an_easy_target_and_the_label_is_put_back():
    boxes = np.array([[40 + index, 30, 16, 14] for index in range(12)], float)
    sequence = TrackingSequence('walk', 'group', Walk(), boxes)
    seen = []

    def noted(size, sigma):
        seen.append(size)
        return gaussian_label(size, sigma)
    contenders = {name: replace(contender) for name, contender in CONTENDERS.items()
                  if 'growing' not in name}
    contenders['noted'] = Contender({'loss': 'unit'}, noted)
    outcomes, margins = compare_losses(contenders, [sequence], 2)
    assert structured_operator.gaussian_label is gaussian_label
    assert len(seen) == 2
    assert all(outcome.success.min() > 0.6 for (outcome,) in outcomes.values())
    assert {len(frames) for several in margins.values() for frames in several} == {11}
    # The label is what the filter learns.
    np.testing.assert_array_equal(outcomes['noted'][0].success,
                                  outcomes['unit anchor'][0].success)
    assert margins['unit anchor'] != margins['unit anchor, 1 - overlap']


def test_contenders_differ():
    settings = {(repr(contender.config), contender.label) for contender in CONTENDERS.values()}
    assert len(settings) == len(CONTENDERS) and next(iter(CONTENDERS)) == 'ridge'
