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

"""Conjugate gradient for a changing right-hand side, with a carried search direction."""

from __future__ import annotations

from collections.abc import Callable

from lmsco_ros.core.backend import Array

__all__ = ['ConjugateGradient', 'Images']

Images = tuple[Array, ...]
"""A vector and linear images of it."""


class ConjugateGradient:
    """
    Preconditioned conjugate gradient that goes on where the last solve stopped.

    Between two solves the right-hand side and the operator change a little. Starting again
    from steepest descent would throw away what was learned of the problem: the direction is
    carried over, Polak-Ribiere takes care of what has changed (clamped at 0), and the step
    length is exact, which makes every step a descent of the current problem.

    Parameters
    ----------
    inner : callable
        Real inner product of two vectors in which the operator is self-adjoint.

    """

    def __init__(self, inner: Callable[[Array, Array], float]) -> None:
        self._inner = inner
        self._direction: Array | None = None
        self._residual: Array | None = None
        self._energy = 0.0

    def solve(self, iterates: Images, residual: Array, steps: int,
              operator: Callable[[Array], tuple[Array, Images]],
              precondition: Callable[[Array], Array]) -> Images:
        """
        Improve the solution of A x = b, for the normal equations (paper, (12)).

        Parameters
        ----------
        iterates : tuple of array
            Current x, shape (n,), and linear images B x of it that the caller wants to keep.
        residual : array, shape (n,)
            b - A x.
        steps : int
            Iterations.
        operator : callable
            p -> A p and the images of p, p itself first.
        precondition : callable
            Applies an approximate inverse of A.

        Returns
        -------
        tuple of array
            New x and its images.

        """
        for _ in range(steps):
            direction = self._next_direction(residual, precondition(residual))
            normal, images = operator(direction)
            curvature = self._inner(direction, normal)
            if curvature <= 0:
                break
            length = self._inner(direction, residual) / curvature
            iterates = tuple(x + length * p for x, p in zip(iterates, images, strict=True))
            residual = residual - length * normal
        return iterates

    def _next_direction(self, residual: Array, descent: Array) -> Array:
        """Return the conjugate direction and remember what the next one needs."""
        energy = self._inner(residual, descent)
        if self._direction is None or self._energy <= 0:
            direction = descent
        else:
            beta = max(0.0, (energy - self._inner(self._residual, descent)) / self._energy)
            direction = descent + beta * self._direction
        self._direction, self._residual, self._energy = direction, residual, energy
        return direction
