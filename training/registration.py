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

"""Trains the registration network: box and presence of a target against its first frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from lmsco_ros.core.backbones.registration import RegistrationNet
from training.examples import ExampleSource, Spread
from training.loop import Batch

__all__ = ['RegistrationObjective', 'registration_batches']


@dataclass(frozen=True)
class RegistrationObjective:
    """
    Error of the box where the target is there, and of the log-odds that it is.

    Attributes
    ----------
    tolerance : float
        Error of a coordinate from which the loss is linear.
    presence_weight : float
        Weight of the log-odds.

    """

    tolerance: float
    presence_weight: float

    def __call__(self, network: RegistrationNet, batch: Batch) -> torch.Tensor:
        """Return the mean loss of a batch."""
        answer, truth = self._answer(network, batch), batch.targets[:, 0]
        present = truth[:, 4]
        gap = torch.nn.functional.smooth_l1_loss(
            answer[:, :4], truth[:, :4], reduction='none', beta=self.tolerance).sum(dim=1)
        box = (gap * present).sum() / present.sum().clamp_min(1)
        presence = torch.nn.functional.binary_cross_entropy_with_logits(answer[:, 4], present)
        return box + self.presence_weight * presence

    def accuracy(self, network: RegistrationNet, batch: Batch) -> float:
        """Return the mean overlap of the corrected box with the true one."""
        present = batch.targets[:, 0, 4] > 0
        answer = self._answer(network, batch)[present, :4]
        return float(_overlap(answer, batch.targets[present, 0, :4]).mean())

    @staticmethod
    def _answer(network: RegistrationNet, batch: Batch) -> torch.Tensor:
        """Return what the network says of the second patch of each example."""
        encodings = network(batch.inputs.flatten(0, 1))[0].unflatten(0, batch.inputs.shape[:2])
        return network.compare(encodings[:, 0], encodings[:, 1])


def _overlap(left: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    """Return the intersection over union of boxes (dx, dy, log w, log h) around a unit box."""
    sizes = [box[:, 2:].exp() for box in (left, right)]
    low = torch.maximum(left[:, :2] - sizes[0] / 2, right[:, :2] - sizes[1] / 2)
    high = torch.minimum(left[:, :2] + sizes[0] / 2, right[:, :2] + sizes[1] / 2)
    shared = (high - low).clamp_min(0).prod(dim=1)
    return shared / (sizes[0].prod(dim=1) + sizes[1].prod(dim=1) - shared)


def registration_batches(source: ExampleSource, size: int, near: Spread, far: Spread,
                         absent_share: float, seed: int) -> Iterator[Batch]:
    """
    Yield batches of `size` examples without end.

    Parameters
    ----------
    source : ExampleSource
        Examples.
    size : int
        Examples in a batch.
    near, far : Spread
        How far the box is off that the patch is laid around; where the target is present, and
        where the patch shows what is around it.
    absent_share : float
        Share of the examples with an absent target.
    seed : int
        Seed of the random numbers.

    """
    rng = np.random.default_rng(seed)
    exact = Spread(0.0, 0.0, 0.0)
    while True:
        absent = rng.random(size) < absent_share
        examples = [source.draw(2, exact, far if gone else near, rng) for gone in absent]
        inputs = np.stack([example.patches for example in examples])
        offsets = np.stack([example.offsets[1] for example in examples])
        # A shift of `far` may still be a small one.
        present = np.abs(offsets[:, :2]).max(axis=1) <= near.shift * 1.5
        known = present | (np.abs(offsets[:, :2]).max(axis=1) > 0.8)
        targets = np.concatenate([offsets, present[:, None]], axis=1).astype(np.float32)
        yield Batch(torch.from_numpy(inputs[known][:, :, None]),
                    torch.from_numpy(targets[known][:, None]))
