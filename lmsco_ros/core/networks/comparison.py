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

"""The bundled network that compares a target with its first frame (training/README.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from lmsco_ros.core.networks.backbone import Backbone, Layer
from lmsco_ros.core.networks.layers import convolve, standardize

__all__ = ['ComparisonNet']


class ComparisonNet(Backbone):
    """
    Whether the target of the first frame is in a patch.

    Both patches show a box in the middle of a region `context` times as wide and as high, so
    that a box that fits looks like the first one whatever its size and aspect.

    Attributes
    ----------
    size : int
        Side of the patches in pixels.
    context : float
        Sides of the region over those of the box.

    """

    layers = {'encoding': Layer(8, 48)}
    size = 64
    context = 2.0

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(1, 16, 6, 2, 2)
        self.conv2 = nn.Conv2d(16, 32, 4, 2, 1)
        self.conv3 = nn.Conv2d(32, 48, 4, 2, 1)
        self.joint1 = nn.Conv2d(96, 64, 3, 1, 1)
        self.joint2 = nn.Conv2d(64, 64, 4, 2, 1)
        self.hidden = nn.Linear(1024, 64)
        self.answer = nn.Linear(64, 1)

    def forward(self, images: torch.Tensor, layers: Sequence[str] = ('encoding',)
                ) -> list[torch.Tensor]:
        """Return the encoding of patches, shape (n, 48, 8, 8)."""
        maps = torch.relu_(self.conv1(standardize(images)))
        maps = torch.relu_(self.conv2(maps))
        return [torch.relu_(self.conv3(maps))]

    @torch.inference_mode()
    def encode(self, patch: np.ndarray) -> torch.Tensor:
        """Return the encoding of one patch, shape (size, size), float32."""
        return self(torch.from_numpy(patch)[None, None].to(self.answer.weight.device))[0]

    @torch.inference_mode()
    def relate(self, reference: torch.Tensor, now: torch.Tensor) -> float:
        """Return the answer of `compare` for one encoding."""
        return float(self.compare(reference, now)[0])

    def reference(self, first: torch.Tensor) -> torch.Tensor:
        """
        Return what a target adds to every comparison with it.

        Parameters
        ----------
        first : tensor, shape (n, 48, 8, 8)
            Encodings of the target in the first frame.

        """
        kernels = self.joint1.weight[:, :first.shape[1]]
        return torch.nn.functional.conv2d(first, kernels, self.joint1.bias, padding=1)

    def compare(self, reference: torch.Tensor, now: torch.Tensor) -> torch.Tensor:
        """
        Return the log-odds that a patch shows the target.

        Parameters
        ----------
        reference : tensor, shape (n, 64, 8, 8)
            What `reference` makes of the target.
        now : tensor, shape (n, 48, 8, 8)
            Encodings of the patches.

        Returns
        -------
        tensor, shape (n,)
            Log-odds.

        """
        kernels = self.joint1.weight[:, -now.shape[1]:]
        maps = torch.relu_(reference + torch.nn.functional.conv2d(now, kernels, padding=1))
        maps = torch.relu_(convolve(maps, self.joint2))
        return self.answer(torch.relu_(self.hidden(maps.flatten(1))))[:, 0]
