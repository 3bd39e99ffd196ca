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

"""The bundled networks: small, for thermal images and for flow images (training/README.md)."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import nn

from lmsco_ros.core.networks.backbone import Backbone, Layer
from lmsco_ros.core.networks.layers import standardize

__all__ = ['ThermalNet', 'ThermalFlowNet']


class _CompactNet(Backbone):
    """
    Three convolutions, and a linear mixture of all that they see.

    Even kernels with stride 2 keep every cell centered on its pixels; padding repeats the border,
    which the margin has filled with the image itself.
    """

    aliases = {'shallow': 'conv1', 'deep': 'features'}
    margin = 0

    def __init__(self) -> None:
        super().__init__()
        widths = [layer.channels for layer in self.layers.values()]
        self.conv1 = nn.Conv2d(self.input_channels, widths[0], 6, 2, 2)
        self.conv2 = nn.Conv2d(widths[0], widths[1], 4, 2, 1)
        self.conv3 = nn.Conv2d(widths[1], widths[2], 3, 1, 1)
        self.features = nn.Conv2d(sum(widths[:3]), widths[3], 1)

    def forward(self, images: torch.Tensor, layers: Sequence[str]) -> list[torch.Tensor]:
        """Return the named layers, computing nothing beyond the deepest of them."""
        maps: dict[str, torch.Tensor] = {}
        last = max(list(self.layers).index(name) for name in layers)
        maps['conv1'] = torch.relu_(self.conv1(self._prepare(images)))
        if last > 0:
            maps['conv2'] = torch.relu_(self.conv2(maps['conv1']))
        if last > 1:
            maps['conv3'] = torch.relu_(self.conv3(maps['conv2']))
        if last > 2:
            pooled = nn.functional.avg_pool2d(maps['conv1'], 2)
            maps['features'] = self.features(
                torch.cat([pooled, maps['conv2'], maps['conv3']], dim=1))
        return [maps[name] for name in layers]

    def _prepare(self, images: torch.Tensor) -> torch.Tensor:
        """Return what the first layer sees."""
        raise NotImplementedError


class ThermalNet(_CompactNet):
    """
    Appearance of a thermal patch; offset and gain of the camera are taken out first.

    Notes
    -----
    Trained through a differentiable correlation filter; see `training/README.md`.

    """

    layers = {'conv1': Layer(2, 24), 'conv2': Layer(4, 48), 'conv3': Layer(4, 48),
              'features': Layer(4, 32)}

    def _prepare(self, images: torch.Tensor) -> torch.Tensor:
        """Return the images with zero mean and about unit contrast."""
        return standardize(images)


class ThermalFlowNet(_CompactNet):
    """Motion of a patch, given as a flow image; no motion becomes no signal."""

    input_channels = 3
    layers = {'conv1': Layer(2, 16), 'conv2': Layer(4, 16), 'conv3': Layer(4, 16),
              'features': Layer(4, 16)}

    def _prepare(self, images: torch.Tensor) -> torch.Tensor:
        """Return the flow in units of the largest that a flow image holds."""
        return (images - 128) / 128
