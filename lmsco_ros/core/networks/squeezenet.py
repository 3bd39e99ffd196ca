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

"""SqueezeNet v1.0 (Iandola et al., 2016) up to fire8: small, for want of VGG-M's weights."""

from __future__ import annotations

from collections.abc import Mapping
import re

import numpy as np
import torch
from torch.nn import Conv2d, Module, ReLU

from lmsco_ros.core.networks.backbone import Layer
from lmsco_ros.core.networks.image_network import ImageNetwork
from lmsco_ros.core.networks.layers import pool

__all__ = ['SqueezeNet']

_FIRES = {2: (96, 16, 64), 3: (128, 16, 64), 4: (128, 32, 128), 5: (256, 32, 128),
          6: (256, 48, 192), 7: (384, 48, 192), 8: (384, 64, 256)}
_FOREIGN_NAMES = {'squeeze1x1': 'squeeze', 'expand1x1': 'expand1', 'expand3x3': 'expand3',
                  'conv1x1_1': 'squeeze', 'conv1x1_2': 'expand1', 'conv3x3_2': 'expand3'}


class Fire(Module):
    """
    A narrow layer and, on it, two wide ones side by side.

    Parameters
    ----------
    channels, narrow, wide : int
        Channels of the input, between, and of each half of the output.

    """

    def __init__(self, channels: int, narrow: int, wide: int) -> None:
        super().__init__()
        self.squeeze = Conv2d(channels, narrow, 1)
        self.expand1 = Conv2d(narrow, wide, 1)
        self.expand3 = Conv2d(narrow, wide, 3, padding=1)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the features, shape (n, 2 wide, H, W)."""
        narrow = self.squeeze(features).relu_()
        return torch.cat([self.expand1(narrow), self.expand3(narrow)], dim=1).relu_()


class SqueezeNet(ImageNetwork):
    """
    A convolution and fire modules; pooled after `conv1` and `fire4`, only for the next.

    On S + 2 `margin` pixels, S a multiple of 8, the fire modules have exactly S / stride cells
    per axis.
    """

    input_channels = 1
    layers = {
        'conv1': Layer(stride=2, channels=96, offset=2.5),
        **{f'fire{number}': Layer(stride=4, channels=2 * _FIRES[number][2], offset=3.5)
           for number in (2, 3, 4)},
        **{f'fire{number}': Layer(stride=8, channels=2 * _FIRES[number][2], offset=5.5)
           for number in (5, 6, 7, 8)},
    }
    aliases = {'shallow': 'conv1', 'deep': 'fire5'}
    margin = 4
    mean = (104.0, 117.0, 123.0)

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = Conv2d(1, 96, 7, stride=2)
        stages: dict[str, tuple[Module, ...]] = {'conv1': (self.conv1, ReLU(inplace=True))}
        for number, sizes in _FIRES.items():
            name, fire = f'fire{number}', Fire(*sizes)
            self.add_module(name, fire)
            stages[name] = (pool(), fire) if number in (2, 5) else (fire,)
        self.stages = stages

    @classmethod
    def own_names(cls, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the arrays under the names of `file_shapes`, with a mean."""
        return {re.sub(r'^(fire\d)/(\w+)\.', _own_name, name): array
                for name, array in super().own_names(arrays).items()}


def _own_name(match: re.Match[str]) -> str:
    """Return the module that a fire module of another framework names."""
    return f'{match[1]}.{_FOREIGN_NAMES.get(match[2], match[2])}.'
