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

"""VGG-M-2048 (Chatfield et al., BMVC 2014), the paper's appearance network, up to conv5."""

from __future__ import annotations

from torch.nn import Conv2d, ReLU

from lmsco_ros.core.networks.backbone import Layer
from lmsco_ros.core.networks.image_network import ImageNetwork
from lmsco_ros.core.networks.layers import LocalResponseNorm, pool

__all__ = ['VGGM']


class VGGM(ImageNetwork):
    """
    Five convolutions; the first two are normalized, and pooled only for the next.

    On S + 2 `margin` pixels, S a multiple of 16, `conv5` has exactly S / 16 cells per axis.
    """

    input_channels = 1
    layers = {
        'conv1': Layer(stride=2, channels=96, offset=2.5),
        'conv2': Layer(stride=8, channels=256, offset=5.5),
        'conv3': Layer(stride=16, channels=512, offset=9.5),
        'conv4': Layer(stride=16, channels=512, offset=9.5),
        'conv5': Layer(stride=16, channels=512, offset=9.5),
    }
    aliases = {'shallow': 'conv1', 'deep': 'conv5'}
    margin = 8
    mean = (123.68, 116.779, 103.939)

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = Conv2d(1, 96, 7, stride=2)
        self.conv2 = Conv2d(96, 256, 5, stride=2, padding=1)
        self.conv3 = Conv2d(256, 512, 3, padding=1)
        self.conv4 = Conv2d(512, 512, 3, padding=1)
        self.conv5 = Conv2d(512, 512, 3, padding=1)
        self.norm1 = LocalResponseNorm(k=2.0, alpha=1e-4)
        self.norm2 = LocalResponseNorm(k=2.0, alpha=1e-4)
        relu = ReLU(inplace=True)
        self.stages = {
            'conv1': (self.conv1, relu, self.norm1),
            'conv2': (pool(), self.conv2, relu, self.norm2),
            'conv3': (pool(), self.conv3, relu),
            'conv4': (self.conv4, relu),
            'conv5': (self.conv5, relu),
        }
