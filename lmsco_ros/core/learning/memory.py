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

"""Training samples with prior weights, and the score operator that they define."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lmsco_ros.core.backend import Array, array_namespace, Backend
from lmsco_ros.core.fourier.series import bandwidth, crop, embed

__all__ = ['PriorWeights', 'SampleMemory', 'score']


def score(blocks: Sequence[Array], filters: Sequence[Array]) -> Array:
    """
    Return S[k] = sum over blocks and channels of Z[k] W[k] (paper, (5)).

    Parameters
    ----------
    blocks : sequence of array, shape (2K_l + 1, K_l + 1, n, C_l)
        Series of the interpolated features, n samples or scales.
    filters : sequence of array, shape (2K_l + 1, K_l + 1, C_l)
        Filter coefficients.

    Returns
    -------
    array, shape (2K + 1, K + 1, n), K the largest K_l
        Series of the scores.

    """
    order = max(bandwidth(block) for block in blocks)
    xp = array_namespace(blocks[0])
    parts = [embed(xp.matmul(block, weights[..., None])[..., 0], order)
             for block, weights in zip(blocks, filters, strict=True)]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


class PriorWeights:
    """
    Importance of each sample: the newest counts 1 / (1 - rate) of the one before it.

    Parameters
    ----------
    capacity : int
        Number of slots.
    learning_rate : float
        Rate in [0, 1); 0 weighs all samples alike.

    """

    def __init__(self, capacity: int, learning_rate: float) -> None:
        self._weights = np.zeros(capacity)
        self._learning_rate = learning_rate
        self._used = 0
        self._newest = 0

    def __len__(self) -> int:
        """Return the number of slots in use."""
        return self._used

    @property
    def values(self) -> np.ndarray:
        """Weights of the slots in use, shape (n,), sum 1."""
        return self._weights[:self._used]

    def take_slot(self) -> int:
        """Give the next sample a free slot, or that of the least important one."""
        if self._used < len(self._weights):
            slot, self._used = self._used, self._used + 1
        else:
            slot = int(np.argmin(self._weights))
        newest = self._weights[self._newest] / (1 - self._learning_rate)
        self._weights[slot] = newest if self._used > 1 else 1.0
        self._weights /= self._weights.sum()
        self._newest = slot
        return slot


class SampleMemory:
    """
    Series of the training samples, in the layout of the score operator.

    The operator A maps a filter to the scores of all samples; `forward` and `adjoint` are the
    two halves of it, the adjoint with respect to the inner product sum_j a_j <., .> of scores,
    a_j being the prior weights.

    Parameters
    ----------
    capacity : int
        Samples kept at most.
    learning_rate : float
        Of the prior weights.
    shapes : sequence of tuple of int
        (2K_l + 1, K_l + 1, C_l) of each block.
    backend : Backend
        Where the samples live.

    Attributes
    ----------
    mean, energy : list of array, shape (2K_l + 1, K_l + 1, C_l)
        Running averages of Z[k] and `|Z[k]|^2`, each new sample entering with its prior weight.

    """

    def __init__(self, capacity: int, learning_rate: float,
                 shapes: Sequence[tuple[int, int, int]], backend: Backend) -> None:
        self._backend = backend
        self._prior = PriorWeights(capacity, learning_rate)
        xp = backend.namespace
        self._storage = [xp.zeros((rows, columns, capacity, channels), dtype=backend.complex,
                                  device=backend.device) for rows, columns, channels in shapes]
        self.mean = [0 * block[:, :, 0, :] for block in self._storage]
        self.energy = [0 * xp.real(block) for block in self.mean]

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self._prior)

    @property
    def order(self) -> int:
        """Bandwidth of the scores."""
        return max(bandwidth(block) for block in self._storage)

    @property
    def weights(self) -> Array:
        """Prior weights a_j, shape (n,), sum 1."""
        return self._backend.asarray(self._prior.values)

    @property
    def blocks(self) -> list[Array]:
        """Series of the samples, shape (2K_l + 1, K_l + 1, n, C_l) per block."""
        return [block[:, :, :len(self), :] for block in self._storage]

    def add(self, sample: Sequence[Array]) -> int:
        """Store a sample, one series (2K_l + 1, K_l + 1, C_l) per block; return its slot."""
        slot = self._prior.take_slot()
        weight = float(self._prior.values[slot])
        xp = array_namespace(self._storage[0])
        for i, series in enumerate(sample):
            self._storage[i][:, :, slot, :] = series
            self.mean[i] += weight * (series - self.mean[i])
            self.energy[i] += weight * (xp.real(xp.conj(series) * series) - self.energy[i])
        return slot

    def forward(self, filters: Sequence[Array]) -> Array:
        """Return the scores of all samples, shape (2K + 1, K + 1, n)."""
        return score(self.blocks, filters)

    def adjoint(self, residual: Array) -> list[Array]:
        """
        Return sum_j a_j conj(Z_j[k]) R_j[k] for every block.

        Parameters
        ----------
        residual : array, shape (2K + 1, K + 1, n)
            One series per sample.

        """
        xp = array_namespace(residual)
        weighted = xp.conj(residual) * self.weights
        result = []
        for block in self.blocks:
            rows = crop(weighted, bandwidth(block))[..., None, :]
            result.append(xp.conj(xp.matmul(rows, block)[..., 0, :]))
        return result
