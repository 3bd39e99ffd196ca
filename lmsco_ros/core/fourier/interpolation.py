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

"""Implicit interpolation of feature channels to continuous functions (paper, (4))."""

from __future__ import annotations

import numpy as np

from lmsco_ros.core.backend import Array
from lmsco_ros.core.fourier.series import analyze

CUBIC_PARAMETER = -0.75
"""Free parameter a of the cubic kernel (Keys), as in C-COT."""


def cubic_spectrum(frequency: np.ndarray) -> np.ndarray:
    """
    Return the Fourier transform B(f) of the cubic interpolation kernel.

    Parameters
    ----------
    frequency : ndarray
        Frequency in periods per cell.

    Notes
    -----
    B(f) = [6 (1 - cos 2 pi f) + 3 a (1 - cos 4 pi f) - (6 + 8 a) pi f sin 2 pi f
    - 2 a pi f sin 4 pi f] / (4 pi^4 f^4), B(0) = 1.

    """
    a = CUBIC_PARAMETER
    frequency = np.asarray(frequency, dtype=np.float64)
    f = np.where(frequency == 0, 1.0, frequency)
    spectrum = (6 * (1 - np.cos(2 * np.pi * f)) + 3 * a * (1 - np.cos(4 * np.pi * f))
                - (6 + 8 * a) * np.pi * f * np.sin(2 * np.pi * f)
                - 2 * a * np.pi * f * np.sin(4 * np.pi * f)) / (4 * np.pi**4 * f**4)
    return np.where(frequency == 0, 1.0, spectrum)


def interpolation_series(size: int) -> np.ndarray:
    """
    Return the series of the kernel b of a block with `size` cells per axis (paper, (4)).

    Returns
    -------
    ndarray, shape (2K + 1, K + 1), complex128
        N^2 b[ky] b[kx] with b[k] = B(k / N) exp(-i pi k / N) / N: the phase puts the sample of
        a cell at the middle of the cell, the factor fits the mean-normalized `analyze`.

    """
    order = (size - 1) // 2
    k = np.arange(-order, order + 1)
    kernel = cubic_spectrum(k / size) * np.exp(-1j * np.pi * k / size)
    return kernel[:, None] * kernel[None, order:]


def interpolate(block: Array, kernel: Array) -> Array:
    """
    Return the series of the interpolated feature channels.

    Parameters
    ----------
    block : array, shape (N, N, C)
        Windowed feature channels of one block.
    kernel : array, shape (2K + 1, K + 1, 1)
        `interpolation_series` of N on the device of `block`.

    Returns
    -------
    array, shape (2K + 1, K + 1, C)
        Coefficients of the interpolated channels (paper, (4)).

    """
    series = analyze(block)
    series *= kernel
    return series
