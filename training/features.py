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

"""Trains the feature networks: what they show must make a correlation filter discriminative."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from lmsco_ros.core.networks.backbone import Backbone
from training.correlation_filter import CorrelationFilter, margin_loss
from training.examples import ExampleSource, Spread
from training.flow_examples import FlowSource
from training.loop import Batch

__all__ = ['FeatureObjective', 'feature_batches']


@dataclass(frozen=True)
class FeatureObjective:
    """
    Loss of the filter in a frame that it has not been trained on.

    Attributes
    ----------
    correlation : CorrelationFilter
        The filter.
    layer : str
        Layer of the network that becomes the features.
    core : float
        Label from which the loss is two-sided.

    """

    correlation: CorrelationFilter
    layer: str
    core: float

    def scores(self, network: Backbone, batch: Batch) -> tuple[torch.Tensor, torch.Tensor]:
        """Return scores and label of the last region of each example, trained on the others."""
        count, views = batch.inputs.shape[:2]
        maps = network(batch.inputs.flatten(0, 1), (self.layer,))[0]
        spectra = self.correlation.prepare(maps).unflatten(0, (count, views))
        filters = self.correlation.train(spectra[:, :-1])
        scores = self.correlation.scores(spectra[:, -1], filters)
        shift = batch.targets[:, -1, :2] / self.correlation.search_factor
        return scores, self.correlation.label(scores.shape[-1], shift)

    def __call__(self, network: Backbone, batch: Batch) -> torch.Tensor:
        """Return the mean loss of a batch."""
        return margin_loss(*self.scores(network, batch), self.core).mean()

    def accuracy(self, network: Backbone, batch: Batch) -> float:
        """Return the share of targets found within a cell and a half."""
        scores, label = self.scores(network, batch)
        cells = scores.shape[-1]
        found, true = (grid.flatten(1).argmax(dim=1) for grid in (scores, label))
        gap = torch.stack([found // cells - true // cells, found % cells - true % cells])
        gap = ((gap + cells // 2) % cells - cells // 2).abs().amax(dim=0)
        return float((gap <= 1).float().mean())


def feature_batches(source: ExampleSource | FlowSource, size: int, views: int, spread: Spread,
                    seed: int) -> Iterator[Batch]:
    """
    Yield batches of `size` examples without end.

    Parameters
    ----------
    source : ExampleSource or FlowSource
        Examples.
    size : int
        Examples in a batch.
    views : int
        Regions of an example: all but the last train the filter.
    spread : Spread
        How far the last region is off its target.
    seed : int
        Seed of the random numbers.

    """
    rng = np.random.default_rng(seed)
    training = Spread(0.0, 0.0, 0.0)
    while True:
        examples = [source.draw(views, training, spread, rng) for _ in range(size)]
        inputs = torch.from_numpy(np.stack([example.patches for example in examples]))
        targets = torch.from_numpy(np.stack([example.offsets for example in examples]))
        yield Batch(inputs.unsqueeze(2) if inputs.ndim == 4 else inputs.movedim(-1, 2), targets)
