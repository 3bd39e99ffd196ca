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

"""
Approximate inverse of the normal operator: diagonal plus rank one.

The normal operator  G^H G + C sum_j a_j A_j^H M^H M A_j  has a diagonal of sample energies and,
if the samples look alike, one dominant direction: that of the weighted mean sample z. Woodbury's
identity inverts  D + u u^H  at the cost of two products.
"""

from __future__ import annotations

from collections.abc import Sequence

from lmsco_ros.core.backend import Array, array_namespace
from lmsco_ros.core.fourier.series import bandwidth, value_at_origin
from lmsco_ros.core.learning.memory import SampleMemory

__all__ = ['CoupledPreconditioner', 'FrequencyPreconditioner']


class FrequencyPreconditioner:
    """
    For M = I: each frequency has its own rank-one part, across the channels of a block.

    Parameters
    ----------
    memory : SampleMemory
        Samples.
    margin_weight : float
        C.
    window_energy : float
        Diagonal of G^H G.

    """

    def __init__(self, memory: SampleMemory, margin_weight: float, window_energy: float) -> None:
        self._parts = []
        for energy, mean in zip(memory.energy, memory.mean, strict=True):
            xp = array_namespace(mean)
            power = xp.real(xp.conj(mean) * mean)
            inverse = 1 / (margin_weight * xp.clip(energy - power, min=0) + window_energy)
            direction = inverse * xp.conj(mean)
            gain = margin_weight / (1 + margin_weight * xp.sum(
                power * inverse, axis=-1, keepdims=True))
            self._parts.append((inverse, direction, mean, gain))

    def apply(self, blocks: Sequence[Array]) -> list[Array]:
        """Return the approximate solution for a right-hand side."""
        result = []
        for block, (inverse, direction, mean, gain) in zip(blocks, self._parts, strict=True):
            xp = array_namespace(block)
            scaled = inverse * block
            along = xp.sum(mean * scaled, axis=-1, keepdims=True)
            result.append(scaled - direction * (gain * along))
        return result


class CoupledPreconditioner:
    """
    For M s = s(0) - s: one rank-one part over all frequencies k != 0.

    M^H M is the identity plus the sum over all other frequencies, whose single eigenvalue is
    as large as the grid.

    Parameters
    ----------
    memory : SampleMemory
        Samples.
    margin_weight : float
        C.
    window_energy : float
        Diagonal of G^H G.

    """

    def __init__(self, memory: SampleMemory, margin_weight: float, window_energy: float) -> None:
        self._inverses = [1 / (margin_weight * energy + window_energy)
                          for energy in memory.energy]
        self._means = [1 * mean for mean in memory.mean]
        for mean in self._means:
            mean[bandwidth(mean), 0, :] = 0
        power = sum(self._total(mean * inverse, array_namespace(mean).conj(mean))
                    for mean, inverse in zip(self._means, self._inverses, strict=True))
        self._gain = margin_weight / (1 + margin_weight * power)

    def apply(self, blocks: Sequence[Array]) -> list[Array]:
        """Return the approximate solution for a right-hand side."""
        scaled = [inverse * block for inverse, block in zip(self._inverses, blocks, strict=True)]
        along = self._gain * sum(self._total(mean, part)
                                 for mean, part in zip(self._means, scaled, strict=True))
        return [part - along * inverse * array_namespace(mean).conj(mean)
                for part, inverse, mean in zip(scaled, self._inverses, self._means, strict=True)]

    @staticmethod
    def _total(mean: Array, block: Array) -> Array:
        """Return sum over k and channels of mean[k] block[k], the whole spectrum."""
        return array_namespace(block).sum(value_at_origin(mean * block))
