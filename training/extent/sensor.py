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

"""What a thermal camera does to pictures, in batches."""

from __future__ import annotations

import torch

from training.extent.pairs import blurred

__all__ = ['through_a_sensor']


def through_a_sensor(images: torch.Tensor) -> torch.Tensor:
    """
    Return pairs of pictures as thermal cameras show them.

    Warm or cold, blurred, with white noise and that of rows and columns, clipped; in a fifth of
    the pairs the later frame has another noise and contrast than the first.

    Parameters
    ----------
    images : tensor, shape (n, 2, S, S)
        Intensities.

    """
    count, device = len(images), images.device
    level = images.mean(dim=(1, 2, 3), keepdim=True)
    images = (images - level) / (images.std(dim=(1, 2, 3), keepdim=True) + 1e-3)
    images = images * torch.where(_draw(count, device) < 0.5, -1.0, 1.0)
    images = blurred(images, (1.5 * _draw(count, device).square()).flatten())
    step = torch.where(_draw(count, device) < 0.2, 1.0, 0.0)
    strength = torch.exp(step * torch.randn(count, 2, 1, 1, device=device))
    white = 0.4 * _draw(count, device)**3 * strength
    lines = 0.25 * _draw(count, device)**3 * strength * (_draw(count, device) < 0.4)
    side = images.shape[-1]
    noisy = images + white * torch.randn_like(images)
    noisy = noisy + lines * torch.randn(count, 2, side, 1, device=device)
    noisy = noisy + lines * torch.randn(count, 2, 1, side, device=device)
    limit = 1.5 + 6 * _draw(count, device)
    return noisy.clamp(-limit, limit)


def _draw(count: int, device: torch.device) -> torch.Tensor:
    """Return evenly distributed numbers, shape (n, 1, 1, 1)."""
    return torch.rand(count, 1, 1, 1, device=device)
