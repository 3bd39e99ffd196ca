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

from collections.abc import Sequence

import numpy as np
import torch

__all__ = ['LocalResponseNorm', 'convolve', 'fold_gray', 'fold_mean', 'fold_normalization',
           'pool', 'standardize']

_CACHED_NUMBERS = 1 << 17
_CONTRAST_FLOOR = 0.02


class LocalResponseNorm(torch.nn.Module):
    """
    Local response normalization across channels, x (k + alpha sum x^2)^(-3/4), fast.

    Parameters
    ----------
    k : float
        Constant term.
    alpha : float
        Factor of each square; frameworks that divide it by the number of neighbors are given
        the quotient.
    reach : int
        Channels that count on either side.

    """

    def __init__(self, k: float, alpha: float, reach: int = 2) -> None:
        super().__init__()
        self._k, self._alpha, self._reach = k, alpha, reach

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the normalized features, shape (n, C, H, W), channels last in memory."""
        count, channels, height, width = features.shape
        rows = features.permute(0, 2, 3, 1).reshape(-1, channels)
        result = torch.empty_like(rows)
        # All steps on a part that stays in the processor's cache: three times as fast.
        part = _CACHED_NUMBERS // channels + 1 if rows.device.type == 'cpu' else len(rows)
        for given, normalized in zip(rows.split(part), result.split(part), strict=True):
            torch.mul(given, self._factor(given), out=normalized)
        return result.reshape(count, height, width, channels).permute(0, 3, 1, 2)

    def _factor(self, rows: torch.Tensor) -> torch.Tensor:
        """Return (k + alpha sum x^2)^(-3/4) for rows of channels, by square roots."""
        squares = rows.square()
        total = squares + self._k / self._alpha
        for shift in range(1, self._reach + 1):
            total[:, shift:] += squares[:, :-shift]
            total[:, :-shift] += squares[:, shift:]
        root = total.mul_(self._alpha).rsqrt_()
        return root.mul_(root.sqrt())


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


def fold_normalization(weight: np.ndarray, normalization: Sequence[np.ndarray],
                       epsilon: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the convolution that needs no normalization of the batch behind it.

    Parameters
    ----------
    weight : ndarray, shape (out, in, kh, kw)
        Kernels of a convolution without bias.
    normalization : sequence of ndarray, shape (out,)
        Factor, shift, mean and variance of factor (x - mean) / sqrt(variance + epsilon) + shift.
    epsilon : float
        Added to the variance.

    Returns
    -------
    weight : ndarray, shape (out, in, kh, kw), float32
    bias : ndarray, shape (out,), float32

    """
    factor, shift, mean, variance = normalization
    gain = factor.astype(np.float64) / np.sqrt(variance.astype(np.float64) + epsilon)
    bias = shift - gain * mean
    return ((weight * gain[:, None, None, None]).astype(np.float32), bias.astype(np.float32))


def standardize(images: torch.Tensor) -> torch.Tensor:
    """Return one-channel images (n, 1, H, W) with zero mean and about unit contrast."""
    centered = images - images.mean(dim=(2, 3), keepdim=True)
    pixels = images.shape[2] * images.shape[3]
    variance = centered.square().sum(dim=(2, 3), keepdim=True) / (pixels - 1)
    return centered / (variance.sqrt() + _CONTRAST_FLOOR)


def convolve(maps: torch.Tensor, layer: torch.nn.Conv2d) -> torch.Tensor:
    """
    Return what a layer makes of small maps, as one product of matrices.

    With many kernels and few places this takes a third of the time of the layer itself, which
    rearranges its kernels in every call.

    Parameters
    ----------
    maps : tensor, shape (n, C, H, W)
        Input.
    layer : Conv2d
        Square kernels, zero padding, alike in both directions.

    """
    margin = (int(layer.padding[0]),) * 4
    places = torch.nn.functional.pad(maps, margin).permute(0, 2, 3, 1)
    for axis in (1, 2):
        places = places.unfold(axis, layer.kernel_size[0], layer.stride[0])
    rows = places.permute(0, 1, 2, 4, 5, 3).flatten(3)
    kernels = layer.weight.permute(0, 2, 3, 1).flatten(1)
    return torch.nn.functional.linear(rows, kernels, layer.bias).permute(0, 3, 1, 2)
