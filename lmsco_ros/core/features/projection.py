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

"""Fewer channels: the principal components of the first sample."""

from __future__ import annotations

import numpy as np

from lmsco_ros.core.backend import Array, Backend, to_numpy

__all__ = ['Projection', 'principal_components']


def principal_components(channels: np.ndarray, count: int) -> np.ndarray:
    """
    Return the directions that keep most of the energy.

    Parameters
    ----------
    channels : ndarray, shape (..., C)
        Feature vectors; their mean is not taken out, since it is part of the features.
    count : int
        Number of directions; all C where there are fewer.

    Returns
    -------
    ndarray, shape (C, min(count, C)), float32
        Orthonormal columns, the strongest first.

    """
    rows = channels.reshape(-1, channels.shape[-1]).astype(np.float64)
    _, directions = np.linalg.eigh(rows.T @ rows)
    return np.ascontiguousarray(directions[:, ::-1][:, :count], np.float32)


class Projection:
    """
    Reduces the channels of one block; learned from the first sample that is not zero.

    Parameters
    ----------
    count : int
        Channels to keep.
    backend : Backend
        Where the channels are.

    """

    def __init__(self, count: int, backend: Backend) -> None:
        self._count = count
        self._backend = backend
        self._matrix: Array | None = None

    def __call__(self, channels: Array) -> Array:
        """Return the projected channels, shape (..., min(count, C))."""
        if self._matrix is None:
            values = to_numpy(channels)
            matrix = self._backend.asarray(principal_components(values, self._count))
            if not values.any():
                return channels @ matrix
            self._matrix = matrix
        return channels @ self._matrix
