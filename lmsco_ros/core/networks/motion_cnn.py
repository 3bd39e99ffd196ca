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

"""The motion network of "Finding action tubes" (Gkioxari and Malik, CVPR 2015), up to conv5."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from torch.nn import Conv2d, ReLU

from lmsco_ros.core.networks.backbone import Layer
from lmsco_ros.core.networks.image_network import ImageNetwork
from lmsco_ros.core.networks.layers import fold_mean, LocalResponseNorm, pool

__all__ = ['MotionCNN']


class MotionCNN(ImageNetwork):
    """
    Five convolutions of flow images; the first two are pooled, then normalized.

    `conv1` and `conv2` are the outputs of their normalizations. On S + 2 `margin` pixels, S a
    multiple of 16, the deeper layers have exactly S / 16 cells per axis.

    The network was trained on pictures whose red, green and blue were u, v and magnitude, read
    in the order blue, green, red: its files hold the kernels for the magnitude first.
    """

    input_channels = 3
    layers = {
        'conv1': Layer(stride=4, channels=96, offset=3.5),
        'conv2': Layer(stride=16, channels=384, offset=13.5),
        'conv3': Layer(stride=16, channels=512, offset=13.5),
        'conv4': Layer(stride=16, channels=512, offset=13.5),
        'conv5': Layer(stride=16, channels=384, offset=13.5),
    }
    aliases = {'shallow': 'conv1', 'deep': 'conv5'}
    margin = 16
    mean = (128.0, 128.0, 128.0)

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = Conv2d(3, 96, 7, stride=2)
        self.conv2 = Conv2d(96, 384, 5, stride=2, groups=2)
        self.conv3 = Conv2d(384, 512, 3, padding=1)
        self.conv4 = Conv2d(512, 512, 3, padding=1, groups=2)
        self.conv5 = Conv2d(512, 384, 3, padding=1, groups=2)
        self.norm1 = LocalResponseNorm(k=1.0, alpha=2e-5)
        self.norm2 = LocalResponseNorm(k=1.0, alpha=2e-5)
        relu = ReLU(inplace=True)
        self.stages = {
            'conv1': (self.conv1, relu, pool(), self.norm1),
            'conv2': (self.conv2, relu, pool(), self.norm2),
            'conv3': (self.conv3, relu),
            'conv4': (self.conv4, relu),
            'conv5': (self.conv5, relu),
        }

    @classmethod
    def _state(cls, arrays: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        """Return the state with the mean folded and the kernels in the order u, v, magnitude."""
        weight = arrays['conv1.weight']
        bias = fold_mean(weight, arrays['conv1.bias'], arrays['mean'])
        state = {**arrays, 'conv1.weight': weight[:, ::-1], 'conv1.bias': bias}
        del state['mean']
        return state
