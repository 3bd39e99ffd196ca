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

from lmsco_ros.core.backbones.backbone import Backbone, Layer
from lmsco_ros.core.backbones.layers import standardize

__all__ = ['RegistrationNet']


class RegistrationNet(Backbone):
    """
    Where, how large, and whether at all a target of the first frame is in a patch.

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
        self.answer = nn.Linear(64, 5)

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
    def relate(self, first: torch.Tensor, now: torch.Tensor) -> np.ndarray:
        """Return the answer of `compare` for one pair of encodings, shape (5,)."""
        return self.compare(first, now)[0].cpu().numpy()

    def compare(self, first: torch.Tensor, now: torch.Tensor) -> torch.Tensor:
        """
        Return where the target is in relation to the box that a patch was laid around.

        Parameters
        ----------
        first, now : tensor, shape (n, 48, 8, 8)
            Encodings of the target in the first frame, and of the patches.

        Returns
        -------
        tensor, shape (n, 5)
            Displacement (x, y) of the center in sizes of the box, logarithms of the factors of
            width and height, and the log-odds that the target is there.

        """
        maps = torch.relu_(self.joint1(torch.cat([first, now], dim=1)))
        maps = torch.relu_(self.joint2(maps))
        return self.answer(torch.relu_(self.hidden(maps.flatten(1))))
