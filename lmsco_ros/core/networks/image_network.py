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

"""What the networks trained on three-channel images of 0..255 have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import re
from typing import ClassVar

import numpy as np
import torch

from lmsco_ros.core.networks.backbone import Backbone
from lmsco_ros.core.networks.layers import fold_gray

__all__ = ['ImageNetwork']

_FULL_SCALE = 255.0
_SHORT_NAMES = {'w': 'weight', 'b': 'bias'}


class ImageNetwork(Backbone):
    """
    A chain of stages that begins with an unpadded convolution `conv1` of three channels.

    The intensity of a thermal image stands for all three. Scale, mean and the sum over channels
    are folded into `conv1`, which is exact and takes a third of its time.

    Attributes
    ----------
    mean : tuple of float
        What was subtracted from the channels in training, where a file of weights does not say.
    deviation : tuple of float
        What the channels were divided by then.
    stages : mapping of str to sequence of modules
        What leads from each layer to the next, named as `layers` are and in their order.

    """

    mean: ClassVar[tuple[float, float, float]]
    deviation: ClassVar[tuple[float, float, float]] = (1.0, 1.0, 1.0)
    stages: Mapping[str, Sequence[torch.nn.Module]]

    @classmethod
    def file_shapes(cls) -> dict[str, tuple[int, ...]]:
        """Return the name and the shape of each array, with three channels before `conv1`."""
        shapes = super().file_shapes()
        out, _, height, width = shapes['conv1.weight']
        return {**shapes, 'conv1.weight': (out, 3, height, width), 'mean': (3,)}

    @classmethod
    def own_names(cls, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the arrays under the names of `file_shapes`, with a mean."""
        named = {re.sub(r'\.([wb])$', lambda match: f'.{_SHORT_NAMES[match[1]]}', name): array
                 for name, array in arrays.items()}
        return {'mean': np.array(cls.mean, np.float32), **named}

    @classmethod
    def _state(cls, arrays: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        """Return the state with `conv1` folded for gray images."""
        weight, bias = fold_gray(
            arrays['conv1.weight'] / np.array(cls.deviation)[:, None, None], arrays['conv1.bias'],
            arrays['mean'], _FULL_SCALE)
        state = {**arrays, 'conv1.weight': weight, 'conv1.bias': bias}
        del state['mean']
        return state

    @torch.no_grad()
    def forward(self, images: torch.Tensor, layers: Sequence[str]) -> list[torch.Tensor]:
        """Return the named layers, computing nothing beyond the deepest of them."""
        missing = {self.layer_name(name) for name in layers}
        features = images.contiguous(memory_format=torch.channels_last)
        found = {}
        for name, stage in self.stages.items():
            if not missing:
                break
            for module in stage:
                features = module(features)
            if name in missing:
                found[name] = features
                missing.remove(name)
        return [found[self.layer_name(name)] for name in layers]
