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

"""Layers that the networks share."""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional

__all__ = ['LocalResponseNorm', 'fold_gray', 'fold_mean', 'pool']


class LocalResponseNorm(torch.nn.Module):
    """
    Local response normalization across channels, x (k + alpha sum x^2)^(-3/4), fast.

    The sum over neighboring channels is a 1x1 convolution with a banded matrix, and the power is
    two square roots.

    Parameters
    ----------
    channels : int
        Number of channels.
    k : float
        Constant term.
    alpha : float
        Factor of each square; frameworks that divide it by the number of neighbors are given
        the quotient.
    neighbors : int
        Channels that count, the middle one included.

    """

    def __init__(self, channels: int, k: float, alpha: float, neighbors: int = 5) -> None:
        super().__init__()
        index = torch.arange(channels, device='cpu')
        near = (index[:, None] - index[None, :]).abs() <= neighbors // 2
        # On the processor even while the shapes of a network are asked for on the meta device:
        # the band belongs to no file of weights.
        self.register_buffer('band', alpha * near.float()[:, :, None, None], persistent=False)
        self.register_buffer('k', torch.full((channels,), k, device='cpu'), persistent=False)
        self.band: torch.Tensor
        self.k: torch.Tensor

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the normalized features, shape (n, C, H, W)."""
        root = functional.conv2d(features.square(), self.band, self.k).rsqrt_()
        return features * root.mul_(root.sqrt())


def pool() -> torch.nn.MaxPool2d:
    """Return 3x3 pooling with stride 2 that keeps incomplete windows at the far border."""
    return torch.nn.MaxPool2d(3, 2, ceil_mode=True)


def fold_mean(weight: np.ndarray, bias: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """
    Return the bias with which a convolution without padding needs no mean subtracted.

    Parameters
    ----------
    weight : ndarray, shape (out, in, kh, kw)
        Kernels.
    bias : ndarray, shape (out,)
        Bias for inputs whose mean was subtracted.
    mean : ndarray, shape (in,)
        That mean.

    """
    sums = weight.astype(np.float64).sum(axis=(2, 3))
    return (bias - sums @ mean.astype(np.float64)).astype(np.float32)


def fold_gray(weight: np.ndarray, bias: np.ndarray, mean: np.ndarray,
              scale: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the one-channel convolution that does to a gray image what the given one does to color.

    It equals the given one, which has no padding, on `scale` times the image in every channel,
    minus the mean.

    Parameters
    ----------
    weight, bias, mean : ndarray
        As for `fold_mean`.
    scale : float
        Number that 1 of the image stands for.

    Returns
    -------
    weight : ndarray, shape (out, 1, kh, kw), float32
    bias : ndarray, shape (out,), float32

    """
    summed = scale * weight.astype(np.float64).sum(axis=1, keepdims=True)
    return summed.astype(np.float32), fold_mean(weight, bias, mean)
