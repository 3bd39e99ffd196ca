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

"""Training against a dense problem that is assembled from its definition on the grid."""

import numpy as np
import pytest

from lmsco_ros.core.config import LearningConfig
from lmsco_ros.core.fourier.series import analyze, inner, synthesize
from lmsco_ros.core.learning.collaborative import CollaborativeOptimizer
from lmsco_ros.core.learning.margin import CoupledAnchor, gaussian_label, make_margin_loss
from lmsco_ros.core.learning.memory import SampleMemory
from lmsco_ros.core.learning.regularization import SpatialWindow, window_series
from lmsco_ros.core.learning.structured_operator import StructuredOperator

SIZE = 9
TARGET = (0.3, 0.4)
WINDOW = (0.1, 0.3, 0.02)
MARGIN_WEIGHT = 40.0
LABEL = np.maximum(gaussian_label(SIZE, (0.1, 0.1)), 0)

# Label from which the loss is two-sided.
CORE = {'unit': 0.5, 'ridge': -np.inf}


class LiteralAnchor(CoupledAnchor):
    """The problem (11)-(12) to the letter: s(y0) is that of the last filter."""

    couples_frequencies = False

    def normal(self, scores):
        """Return S: M is the identity."""
        return scores

    def slack_targets(self, scores):
        """Return the series of rho = s(0) - l - eps at these scores."""
        values = synthesize(scores, SIZE)
        origin = values[:1, :1, :]
        return analyze(origin - np.maximum(origin - values, 1 - LABEL[:, :, None]))


class Training:
    """A small training problem in both forms."""

    def __init__(self, backend, band, dense_problem, parabolic_window, rng, loss):
        self.name = loss
        spaces = [(band(4, SIZE), 2), (band(2, SIZE), 1)]
        shapes = [(2 * s.order + 1, s.order + 1, c) for s, c in spaces]
        self.memory = SampleMemory(5, 0.2, shapes, backend)
        common = [rng.normal(size=(SIZE, SIZE, c)) for _, c in spaces]
        samples = [[s.series(z + 0.5 * rng.normal(size=z.shape))
                    for (s, _), z in zip(spaces, common, strict=True)] for _ in range(3)]
        for sample in samples:
            self.memory.add(sample)
        self.loss = (LiteralAnchor(backend.asarray(LABEL)) if loss == 'literal'
                     else make_margin_loss(loss, LABEL, backend))
        series = window_series(TARGET, *WINDOW)
        self.windows = [SpatialWindow(series, s.order, backend) for s, _ in spaces]
        self.optimizer = CollaborativeOptimizer(self.memory, self.loss, self.windows,
                                                MARGIN_WEIGHT)
        gamma, _ = parabolic_window(TARGET, *WINDOW, 40)
        values = [(s, np.stack([s.values(sample[i]) for sample in samples], axis=2))
                  for i, (s, _) in enumerate(spaces)]
        self.dense = dense_problem(values, self.memory.weights, gamma, MARGIN_WEIGHT)

    def random_filters(self, rng):
        """Return random filters."""
        return [analyze(rng.normal(size=(b.shape[0], b.shape[0], b.shape[2])))
                for b in self.optimizer.filters]

    def normal(self, filters):
        """Return the normal operator without a matrix."""
        residual = self.memory.adjoint(self.loss.normal(self.memory.forward(filters)))
        return [window.gram(block) + MARGIN_WEIGHT * part
                for window, block, part in zip(self.windows, filters, residual, strict=True)]

    def residual(self, filters):
        """Return right-hand side minus left-hand side after the slack step at `filters`."""
        scores = self.memory.forward(filters)
        parts = self.memory.adjoint(self.loss.slack_targets(scores))
        return [MARGIN_WEIGHT * part - left
                for part, left in zip(parts, self.normal(filters), strict=True)]

    def margin(self):
        """Return the matrix M on the grid."""
        matrix = np.eye(SIZE**2)
        if self.name == 'coupled':
            matrix = np.eye(1, SIZE**2) - matrix
        return matrix

    def slack_targets(self, coordinates):
        """Return q of every sample, (n, N^2)."""
        s, m = self.dense.scores @ coordinates, LABEL.reshape(-1)
        if self.name in CORE:
            return np.where(m >= CORE[self.name], m, np.minimum(m, s))
        q = np.maximum(1 - m, s[:, :1] - s)
        return q if self.name == 'coupled' else s[:, :1] - q

    def matrix(self):
        """Return the normal matrix."""
        rows = self.margin() @ self.dense.scores
        gram = np.einsum('j,jtp,jtq->pq', self.dense.weights, rows, rows) / SIZE**2
        return self.dense.penalty + MARGIN_WEIGHT * gram

    def right_hand_side(self, coordinates):
        """Return C sum_j a_j A_j^T M^T q_j, the slack taken at `coordinates`."""
        rows = self.margin() @ self.dense.scores
        q = self.slack_targets(coordinates)
        return MARGIN_WEIGHT * np.einsum('j,jtp,jt->p', self.dense.weights, rows, q) / SIZE**2

    def objective(self, coordinates):
        """Return E."""
        s, m = self.dense.scores @ coordinates, LABEL.reshape(-1)
        hinge = np.maximum(0, (1 - m) - (s[:, :1] - s))**2
        if self.name in CORE:
            hinge = np.where(m >= CORE[self.name], (s - m)**2, np.maximum(0, s - m)**2)
        return float(coordinates @ self.dense.penalty @ coordinates
                     + MARGIN_WEIGHT * self.dense.weights @ hinge.mean(axis=1))


@pytest.fixture
def make(backend, band, dense_problem, parabolic_window, rng):
    """Return the factory of training problems."""
    return lambda loss: Training(backend, band, dense_problem, parabolic_window, rng, loss)


def dot(left, right):
    """Return the inner product of two filters."""
    return sum(float(np.sum(inner(a, b))) for a, b in zip(left, right, strict=True))


@pytest.mark.parametrize('loss', ['unit', 'ridge', 'coupled'])
def test_normal_operator_against_the_dense_matrix(make, rng, loss):
    training = make(loss)
    filters = training.random_filters(rng)
    expected = training.matrix() @ training.dense.pack(filters)
    np.testing.assert_allclose(training.dense.pack(training.normal(filters)), expected,
                               rtol=1e-5, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize('loss', ['unit', 'ridge', 'coupled'])
def test_normal_operator_passes_the_dot_test(make, rng, loss):
    training = make(loss)
    one, other = training.random_filters(rng), training.random_filters(rng)
    assert dot(training.normal(one), other) == pytest.approx(
        dot(one, training.normal(other)), rel=1e-11)
    assert dot(one, training.normal(one)) > 0


@pytest.mark.parametrize('loss', ['unit', 'ridge', 'coupled'])
def test_objective_against_the_dense_one(make, rng, loss):
    training = make(loss)
    training.optimizer.filters = training.random_filters(rng)
    expected = training.objective(training.dense.pack(training.optimizer.filters))
    assert training.optimizer.objective() == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize('loss', ['unit', 'ridge', 'coupled'])
def test_residual_is_the_negative_half_gradient(make, rng, loss):
    training = make(loss)
    filters, direction = training.random_filters(rng), training.random_filters(rng)
    values, step = [], 1e-5
    for sign in (1, -1):
        training.optimizer.filters = [w + sign * step * d
                                      for w, d in zip(filters, direction, strict=True)]
        values.append(training.optimizer.objective())
    slope = (values[0] - values[1]) / (2 * step)
    assert slope == pytest.approx(-2 * dot(training.residual(filters), direction), rel=1e-6)


@pytest.mark.parametrize('loss', ['unit', 'coupled', 'literal'])
def test_converged_gradient_steps_agree_with_the_dense_solve(make, loss):
    training = make(loss)
    coordinates = np.zeros(len(training.dense.penalty))
    for _ in range(2):
        training.optimizer.optimize(1, 120)
        coordinates = np.linalg.solve(training.matrix(), training.right_hand_side(coordinates))
        np.testing.assert_allclose(training.dense.pack(training.optimizer.filters), coordinates,
                                   atol=1e-4 * np.abs(coordinates).max())


@pytest.mark.parametrize('loss', ['unit', 'ridge', 'coupled'])
@pytest.mark.parametrize('steps', [1, 2, 40])
def test_objective_never_grows(make, loss, steps):
    training = make(loss)
    values = [training.optimizer.objective()]
    for _ in range(15):
        training.optimizer.optimize(1, steps)
        values.append(training.optimizer.objective())
    assert np.all(np.diff(values) <= 1e-9 * values[0])
    assert values[-1] < 0.7 * values[0]


def test_literal_problem_is_not_monotone(make):
    training = make('literal')
    values = []
    for _ in range(12):
        training.optimizer.optimize(1, 40)
        values.append(training.optimizer.objective())
    assert max(np.diff(values)) > 0
    assert values[-1] > 3 * values[0]


@pytest.mark.parametrize('loss', ['unit', 'ridge', 'coupled'])
def test_many_iterations_reach_the_minimum_of_the_dense_problem(make, loss):
    training = make(loss)
    training.optimizer.optimize(100, 5)
    reached = training.dense.pack(training.optimizer.filters)
    gradient = training.matrix() @ reached - training.right_hand_side(reached)
    scale = np.linalg.norm(training.right_hand_side(0 * reached))
    assert np.linalg.norm(gradient) < 1e-3 * scale


def test_ridge_regression_against_the_dense_one(make):
    training = make('ridge')
    training.optimizer.optimize(1, 150)
    rows = training.dense.scores.reshape(-1, training.dense.scores.shape[2])
    weights = np.repeat(training.dense.weights, SIZE**2) / SIZE**2
    normal = training.dense.penalty + MARGIN_WEIGHT * rows.T @ (weights[:, None] * rows)
    label = np.tile(LABEL.reshape(-1), 3)
    expected = np.linalg.solve(normal, MARGIN_WEIGHT * rows.T @ (weights * label))
    np.testing.assert_allclose(training.dense.pack(training.optimizer.filters), expected,
                               atol=1e-4 * np.abs(expected).max())


def test_ridge_regression_of_one_channel_has_a_closed_form(backend, rng):
    # With a constant window every frequency stands for itself.
    config = LearningConfig(loss='ridge', margin_weight=5.0, window_minimum=0.2, window_edge=0.2,
                            label_sigma=0.5, initial_iterations=1, gradient_steps=200)
    sample = analyze(rng.normal(size=(SIZE, SIZE, 1)))
    operator = StructuredOperator(config, [sample], TARGET, backend)
    sigma = 0.5 * np.sqrt(TARGET[0] * TARGET[1])
    label = analyze(gaussian_label(SIZE, (sigma, sigma)))[:, :, None]
    expected = 5.0 * sample.conj() * label / (5.0 * np.abs(sample)**2 + 0.2**2)
    np.testing.assert_allclose(operator.filters[0], expected, atol=1e-9)


def test_filters_stay_real_functions(make):
    training = make('unit')
    training.optimizer.optimize(30, 2)
    for block in training.optimizer.filters:
        np.testing.assert_array_equal(block[::-1, 0], block[:, 0].conj())
