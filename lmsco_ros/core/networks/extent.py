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

"""The bundled network that measures the extent of a target (training/README.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from lmsco_ros.core.networks.backbone import Backbone, Layer
from lmsco_ros.core.networks.layers import convolve, standardize

__all__ = ['ExtentNet', 'Question']

_CONTRAST_LIMIT = 6.0


Question = tuple[np.ndarray, torch.Tensor, tuple[float, float]]
"""A patch, shape (3, size, size); what `reference` makes of the target; sides as in `measure`."""


class ExtentNet(Backbone):
    """
    Where the four edges of a target are, how sure that is, and whether the target is there.

    A Siamese network: one encoder for the first frame's target and for what is to be measured,
    and a head for both. A patch shows a square of `context` times the side of a box (that of a
    square of its area) in three channels: intensity, 1 inside of the box, 1 inside of the image.

    Attributes
    ----------
    size : int
        Side of the patches in pixels.
    context : float
        Side of the square over the side of the box.

    """

    input_channels = 3
    layers = {'encoding': Layer(8, 64)}
    size = 64
    context = 3.0

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, 24, 4, 2, 1)
        self.conv2 = nn.Conv2d(24, 48, 4, 2, 1)
        self.conv3 = nn.Conv2d(48, 64, 4, 2, 1)
        self.joint1 = nn.Conv2d(128, 96, 3, 1, 1)
        self.joint2 = nn.Conv2d(96, 128, 4, 2, 1)
        self.hidden = nn.Linear(16 * 128 + 2, 128)
        self.answer = nn.Linear(128, 9)

    def forward(self, images: torch.Tensor, layers: Sequence[str] = ('encoding',)
                ) -> list[torch.Tensor]:
        """Return the encoding of patches, shape (n, 64, 8, 8)."""
        intensity = standardize(images[:, :1]).clamp(-_CONTRAST_LIMIT, _CONTRAST_LIMIT)
        maps = torch.relu_(self.conv1(torch.cat([intensity, images[:, 1:]], dim=1)))
        maps = torch.relu_(self.conv2(maps))
        return [torch.relu_(self.conv3(maps))]

    @torch.inference_mode()
    def encode(self, patch: np.ndarray) -> torch.Tensor:
        """Return the encoding of one patch, shape (3, size, size), float32."""
        return self(torch.from_numpy(patch)[None].to(self.answer.weight.device))[0]

    @property
    def nothing(self) -> torch.Tensor:
        """Encoding in place of that of a target that was never marked, shape (1, 64, 8, 8)."""
        return self.answer.weight.new_zeros(1, 64, 8, 8)

    @torch.inference_mode()
    def answers(self, questions: Sequence[Question]) -> list[np.ndarray]:
        """Return what `measure` says to each of several questions, shape (9,), float64."""
        images = torch.from_numpy(np.stack([patch for patch, _, _ in questions]))
        encodings = self(images.to(self.answer.weight.device))[0].split(1)
        # One by one: in a batch this part gives other bits, which what is measured feeds back.
        # One right after the other: the weights are still in the caches of the processor.
        told = [self.measure(reference, now, now.new_tensor([sides]))[0]
                for (_, reference, sides), now in zip(questions, encodings, strict=True)]
        return [answer.cpu().numpy().astype(np.float64) for answer in told]

    def reference(self, first: torch.Tensor) -> torch.Tensor:
        """
        Return what the first frame's target adds to every measurement.

        Parameters
        ----------
        first : tensor, shape (n, 64, 8, 8)
            Its encodings; zeros for a target that was never marked.

        """
        kernels = self.joint1.weight[:, :first.shape[1]]
        return nn.functional.conv2d(first, kernels, self.joint1.bias, padding=1)

    def measure(self, reference: torch.Tensor, now: torch.Tensor,
                sides: torch.Tensor) -> torch.Tensor:
        """
        Return edges, their scales and the log-odds of presence.

        Parameters
        ----------
        reference : tensor, shape (n, 96, 8, 8)
            What `reference` makes of the target.
        now : tensor, shape (n, 64, 8, 8)
            Encodings of the patches.
        sides : tensor, shape (n, 2)
            Binary logarithms of the sides, in pixels, of the first box (0 where there was none)
            and of the box in the patch.

        Returns
        -------
        tensor, shape (n, 9)
            Left, top, right and bottom edge of the target from the same edge of the box, in
            halves of the patch; natural logarithms of the scales of their (Laplace) errors in
            the same unit; log-odds that the box is at the target.

        """
        kernels = self.joint1.weight[:, -now.shape[1]:]
        maps = torch.relu_(reference + nn.functional.conv2d(now, kernels, padding=1))
        maps = torch.relu_(convolve(maps, self.joint2))
        hidden = self.hidden(torch.cat([maps.flatten(1), sides - 4], dim=1))
        return self.answer(torch.relu_(hidden))
