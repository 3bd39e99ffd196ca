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

"""Pairs of patches that show a target and what is not it, and what is learned from them."""

import numpy as np
import pytest
import torch

from lmsco_ros.core.networks.comparison import ComparisonNet
from training.comparison import comparison_batches, ComparisonObjective
from training.examples import Spread
from training.loop import Batch
from training.pairs import KINDS, PairSource

SHARES = {'present': 0.5, 'near': 0.2, 'erased': 0.2, 'other': 0.1}


@pytest.fixture
def source(clip, still):
    """Return pairs of targets that are hit exactly."""
    return PairSource([clip], [still], 64, 2.0, 0.5, Spread(0.0, 0.0, 0.0), (1.0, 3.0))


def contrast(patch):
    """Return how much the middle of a patch differs from its rim."""
    rim = np.concatenate([patch[:8].ravel(), patch[-8:].ravel()])
    return abs(patch[28:36, 28:36].mean() - np.median(rim))


@pytest.mark.parametrize('kind', KINDS)
def test_second_patch_shows_what_its_kind_says(source, kind):
    rng = np.random.default_rng(5)
    seen = []
    for _ in range(40):
        patches, present = source.draw(kind, rng)
        assert patches.shape == (2, 64, 64) and patches.dtype == np.float32
        assert present == (kind == 'present')
        seen.append(contrast(patches[1]) / contrast(patches[0]))
    if kind in ('present', 'other'):
        assert np.mean(np.array(seen) > 0.3) > 0.85
    else:
        assert np.mean(np.array(seen) < 0.3) > 0.85


def test_images_of_the_source_stay_as_they_are(source, clip, still):
    before = clip.frames.copy(), still.image.copy()
    rng = np.random.default_rng(2)
    for kind in KINDS * 5:
        source.draw(kind, rng)
    np.testing.assert_array_equal(clip.frames, before[0])
    np.testing.assert_array_equal(still.image, before[1])


def test_seeds_make_two_runs_of_batches_equal(source):
    one, again, other = (next(comparison_batches(source, 12, SHARES, seed))
                         for seed in (1, 1, 2))
    assert one.inputs.equal(again.inputs) and one.targets.equal(again.targets)
    assert not one.inputs.equal(other.inputs)
    assert one.inputs.shape == (12, 2, 1, 64, 64) and one.targets.shape == (12, 1, 1)


def test_kinds_are_drawn_as_often_as_asked_for(source):
    batch = next(comparison_batches(source, 200, SHARES, 4))
    assert float(batch.targets.mean()) == pytest.approx(0.5, abs=0.1)
    never = next(comparison_batches(source, 10, {'near': 1.0}, 4))
    assert float(never.targets.sum()) == 0


class Fixed(ComparisonNet):
    """Answers with the mean of the second patch."""

    def forward(self, images, layers=('encoding',)):
        return [images.mean(dim=(2, 3), keepdim=True)]

    def compare(self, first, now):
        return now[:, 0, 0, 0]


def test_loss_and_accuracy_are_those_of_the_definition():
    odds, present = torch.tensor([2.0, -1.0, 0.5, -3.0]), torch.tensor([1.0, 1.0, 0.0, 0.0])
    inputs = odds[:, None, None, None, None].expand(4, 2, 1, 8, 8)
    batch = Batch(inputs, present[:, None, None])
    right = torch.where(present > 0, odds, -odds)
    expected = torch.log1p(torch.exp(-right)).mean()
    objective = ComparisonObjective()
    assert float(objective(Fixed(), batch)) == pytest.approx(float(expected))
    # Of the four pairs, only -1.0 against 0.5 is in the wrong order.
    assert objective.accuracy(Fixed(), batch) == pytest.approx(0.75)
