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

"""Collaborative optimization of slack and filter (paper, section III-B, (8)-(12))."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from lmsco_ros.core.backend import Array, array_namespace
from lmsco_ros.core.fourier.series import half_weights, mean_of_squares, symmetrize
from lmsco_ros.core.learning.conjugate_gradient import ConjugateGradient, Images
from lmsco_ros.core.learning.margin import MarginLoss
from lmsco_ros.core.learning.memory import SampleMemory
from lmsco_ros.core.learning.preconditioner import CoupledPreconditioner, FrequencyPreconditioner
from lmsco_ros.core.learning.regularization import SpatialWindow

__all__ = ['CollaborativeOptimizer']


class CollaborativeOptimizer:
    """
    Minimizes E(W) = ||G W||^2 + C sum_j a_j mean_t loss_j(t) over the filter W.

    Each outer iteration solves for the slack in closed form (9) and then takes a few steps of
    conjugate gradient on the normal equations of the filter (10):
    [G^H G + C sum_j a_j A_j^H M^H M A_j] W = C sum_j a_j A_j^H M^H q_j.

    Parameters
    ----------
    memory : SampleMemory
        Samples; defines A_j and a_j.
    loss : MarginLoss
        Margin loss; defines M and q_j.
    windows : sequence of SpatialWindow
        G, one per block.
    margin_weight : float
        C.

    """

    def __init__(self, memory: SampleMemory, loss: MarginLoss,
                 windows: Sequence[SpatialWindow], margin_weight: float) -> None:
        self._memory = memory
        self._loss = loss
        self._windows = windows
        self._margin_weight = margin_weight
        self.filters = [0 * block[:, :, 0, :] for block in memory.blocks]
        weights = self._flatten([_full_weights(block) for block in self.filters])
        # No function of its own: those cannot be copied and pickled with the tracker.
        self._solver = ConjugateGradient(partial(_inner_product, weights))

    def optimize(self, outer: int, steps: int) -> None:
        """Run `outer` iterations with `steps` conjugate gradient steps each."""
        kind = CoupledPreconditioner if self._loss.couples_frequencies else FrequencyPreconditioner
        preconditioner = kind(self._memory, self._margin_weight, self._windows[0].energy)

        def precondition(vector: Array) -> Array:
            return self._flatten(preconditioner.apply(self._split(vector)))

        iterates = self._images(self._flatten(self.filters))
        for _ in range(outer):
            _, penalty, scores = iterates
            gap = self._loss.slack_targets(scores) - self._loss.normal(scores)
            residual = self._adjoint(gap) - penalty
            iterates = self._solver.solve(iterates, residual, steps, self._normal, precondition)
        self.filters = [symmetrize(block) for block in self._split(iterates[0])]

    def objective(self) -> float:
        """Return E(W) (paper, (7))."""
        xp = array_namespace(self.filters[0])
        penalty = sum(float(xp.sum(mean_of_squares(window.apply(block))))
                      for window, block in zip(self._windows, self.filters, strict=True))
        losses = self._loss.losses(self._memory.forward(self.filters))
        return penalty + self._margin_weight * float(xp.sum(self._memory.weights * losses))

    def _normal(self, vector: Array) -> tuple[Array, Images]:
        """Return the normal operator of a filter (paper, (12)), and the filter's images."""
        images = self._images(vector)
        _, penalty, scores = images
        return penalty + self._adjoint(self._loss.normal(scores)), images

    def _images(self, vector: Array) -> Images:
        """Return the filter W, G^H G W, and its scores of the samples."""
        filters = self._split(vector)
        penalty = self._flatten([window.gram(block)
                                 for window, block in zip(self._windows, filters, strict=True)])
        return vector, penalty, self._memory.forward(filters)

    def _adjoint(self, residual: Array) -> Array:
        """Return C sum_j a_j A_j^H R_j."""
        return self._margin_weight * self._flatten(self._memory.adjoint(residual))

    def _flatten(self, blocks: Sequence[Array]) -> Array:
        """Return the blocks as one vector."""
        xp = array_namespace(blocks[0])
        return xp.concat([xp.reshape(block, (-1,)) for block in blocks])

    def _split(self, vector: Array) -> list[Array]:
        """Return the blocks of a vector."""
        xp = array_namespace(vector)
        blocks, start = [], 0
        for block in self.filters:
            count = block.shape[0] * block.shape[1] * block.shape[2]
            blocks.append(xp.reshape(vector[start:start + count], block.shape))
            start += count
        return blocks


def _full_weights(block: Array) -> Array:
    """Return how often each half-spectrum coefficient counts, in the shape of `block`."""
    xp = array_namespace(block)
    return xp.broadcast_to(half_weights(block)[None, :, None], block.shape)


def _inner_product(weights: Array, left: Array, right: Array) -> float:
    """Return the real inner product over whole spectra whose halves count with `weights`."""
    xp = array_namespace(weights)
    return float(xp.real(xp.vecdot(left, weights * right)))
