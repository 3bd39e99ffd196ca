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

"""The conjugate gradient solver on small dense problems."""

import numpy as np
import pytest

from lmsco_ros.core.learning.conjugate_gradient import ConjugateGradient


class Hinge:
    """
    Minimize |D w|^2 + |max(0, A w - b)|^2 + |K w - 1|^2, by slack steps and linear solves.

    The slack step keeps the operator and changes the right-hand side, as training does.
    """

    def __init__(self, rng, size=60):
        self.rows = rng.normal(size=(3 * size, size)) * np.logspace(0, -2, size)
        self.bound = rng.normal(size=3 * size)
        self.core = rng.normal(size=(5, size))
        self.ridge = 1e-3
        self.matrix = (self.rows.T @ self.rows + self.core.T @ self.core
                       + self.ridge * np.eye(size))
        self.zero = np.zeros(size)

    def operator(self, vector):
        return self.matrix @ vector, (vector,)

    def objective(self, w):
        hinge = np.maximum(0, self.rows @ w - self.bound)
        return self.ridge * w @ w + hinge @ hinge + np.sum((self.core @ w - 1)**2)

    def residual(self, w):
        target = np.minimum(self.rows @ w, self.bound)
        return self.rows.T @ target + self.core.T @ np.ones(5) - self.matrix @ w

    def train(self, outer, steps, restart):
        solvers = [ConjugateGradient(lambda a, b: float(a @ b)) for _ in range(outer)]
        iterates = (self.zero,)
        values = []
        for solver in solvers if restart else outer * solvers[:1]:
            iterates = solver.solve(iterates, self.residual(iterates[0]), steps, self.operator,
                                    lambda r: r)
            values.append(self.objective(iterates[0]))
        return values


@pytest.fixture
def hinge(rng):
    return Hinge(rng)


def solve(matrix, right, steps, precondition=None, start=None):
    """Return the solution after some steps."""
    solver = ConjugateGradient(lambda a, b: float(np.vdot(a, b).real))
    start = np.zeros_like(right) if start is None else start
    return solver.solve((start,), right - matrix @ start, steps,
                        lambda p: (matrix @ p, (p,)), precondition or (lambda r: r))[0]


def spd(rng, size, condition=100.0):
    """Return a symmetric positive definite matrix."""
    basis, _ = np.linalg.qr(rng.normal(size=(size, size)))
    return basis @ np.diag(np.logspace(0, np.log10(condition), size)) @ basis.T


def test_reaches_the_dense_solution(rng):
    matrix, right = spd(rng, 20), rng.normal(size=20)
    np.testing.assert_allclose(solve(matrix, right, 60), np.linalg.solve(matrix, right),
                               rtol=1e-8)


def test_needs_as_many_steps_as_there_are_eigenvalues(rng):
    basis, _ = np.linalg.qr(rng.normal(size=(20, 20)))
    matrix = basis @ np.diag(np.repeat([1.0, 5.0, 30.0], [10, 6, 4])) @ basis.T
    right = rng.normal(size=20)
    np.testing.assert_allclose(solve(matrix, right, 3), np.linalg.solve(matrix, right),
                               rtol=1e-9)


def test_complex_problem(rng):
    half = rng.normal(size=(12, 12)) + 1j * rng.normal(size=(12, 12))
    matrix = half @ half.conj().T + np.eye(12)
    right = rng.normal(size=12) + 1j * rng.normal(size=12)
    np.testing.assert_allclose(solve(matrix, right, 60), np.linalg.solve(matrix, right),
                               rtol=1e-6)


def test_exact_preconditioner_needs_one_step(rng):
    matrix, right = spd(rng, 20), rng.normal(size=20)
    result = solve(matrix, right, 1, lambda r: np.linalg.solve(matrix, r))
    np.testing.assert_allclose(result, np.linalg.solve(matrix, right), rtol=1e-9)


def test_starts_from_the_given_solution(rng):
    matrix, right = spd(rng, 10), rng.normal(size=10)
    exact = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(solve(matrix, right, 2, start=exact), exact, rtol=1e-12)


def test_nothing_to_do_is_no_error():
    np.testing.assert_array_equal(solve(np.eye(4), np.zeros(4), 3), np.zeros(4))


def test_images_follow_the_solution(rng):
    matrix, right = spd(rng, 8), rng.normal(size=8)
    image = rng.normal(size=(5, 8))
    solver = ConjugateGradient(lambda a, b: float(a @ b))
    start = rng.normal(size=8)
    iterate, followed = solver.solve((start, image @ start), right - matrix @ start, 4,
                                     lambda p: (matrix @ p, (p, image @ p)), lambda r: r)
    np.testing.assert_allclose(followed, image @ iterate, rtol=1e-10)


def test_every_step_descends_after_the_right_hand_side_changed(rng):
    matrix = spd(rng, 20, 1e4)
    solver = ConjugateGradient(lambda a, b: float(a @ b))
    x = np.zeros(20)
    for _ in range(10):
        right = rng.normal(size=20)
        before = 0.5 * x @ matrix @ x - right @ x
        x, = solver.solve((x,), right - matrix @ x, 1, lambda p: (matrix @ p, (p,)), lambda r: r)
        assert 0.5 * x @ matrix @ x - right @ x <= before + 1e-12


@pytest.mark.parametrize('restart', [False, True])
def test_training_never_raises_the_objective(hinge, restart):
    values = [hinge.objective(hinge.zero), *hinge.train(60, 2, restart)]
    assert np.all(np.diff(values) <= 1e-10)


def test_carried_direction_beats_restart(hinge):
    best = hinge.train(400, 20, restart=False)[-1]
    carried, restarted = (hinge.train(60, 2, restart)[-1] - best for restart in (False, True))
    assert best > 0 and carried >= -1e-9
    assert carried < 0.5 * restarted
