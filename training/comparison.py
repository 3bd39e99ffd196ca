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

"""Trains the comparison network: whether the target of the first frame is in a patch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import torch

from lmsco_ros.core.networks.comparison import ComparisonNet
from training.loop import Batch
from training.pairs import PairSource

__all__ = ['comparison_batches', 'ComparisonObjective']


class ComparisonObjective:
    """Cross-entropy of the log-odds that the target is there."""

    def __call__(self, network: ComparisonNet, batch: Batch) -> torch.Tensor:
        """Return the mean loss of a batch."""
        return torch.nn.functional.binary_cross_entropy_with_logits(
            self._answer(network, batch), batch.targets[:, 0, 0])

    def accuracy(self, network: ComparisonNet, batch: Batch) -> float:
        """Return the chance that a present target gets higher odds than an absent one."""
        answer, present = self._answer(network, batch), batch.targets[:, 0, 0] > 0
        pairs = answer[present][:, None] > answer[~present][None]
        return float(pairs.float().mean())

    @staticmethod
    def _answer(network: ComparisonNet, batch: Batch) -> torch.Tensor:
        """Return what the network says of the second patch of each example."""
        encodings = network(batch.inputs.flatten(0, 1))[0].unflatten(0, batch.inputs.shape[:2])
        return network.compare(network.reference(encodings[:, 0]), encodings[:, 1])


def comparison_batches(source: PairSource, size: int, shares: Mapping[str, float],
                       seed: int) -> Iterator[Batch]:
    """
    Yield batches of `size` examples without end.

    Parameters
    ----------
    source : PairSource
        Examples.
    size : int
        Examples in a batch.
    shares : mapping of str to float
        How often each kind of example is drawn; sum 1.
    seed : int
        Seed of the random numbers.

    """
    rng = np.random.default_rng(seed)
    kinds, chances = list(shares), list(shares.values())
    while True:
        drawn = [source.draw(str(kind), rng) for kind in rng.choice(kinds, size, p=chances)]
        inputs = np.stack([patches for patches, _ in drawn])
        targets = np.array([[[present]] for _, present in drawn], np.float32)
        yield Batch(torch.from_numpy(inputs[:, :, None]), torch.from_numpy(targets))
