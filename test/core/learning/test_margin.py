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

"""The margin loss against its definition on the grid of shifts."""

import numpy as np
import pytest

from lmsco_ros.core.fourier.series import analyze, inner, synthesize
from lmsco_ros.core.learning.margin import gaussian_label, make_margin_loss

SIZE = 9
LOSSES = ('unit', 'coupled', 'ridge')
# Label from which the loss is two-sided.
CORE = {'unit': 0.5, 'ridge': -np.inf}


@pytest.fixture
def label():
    return gaussian_label(SIZE, (0.12, 0.17))


@pytest.fixture
def scores(rng, label):
    """Return series of scores on both sides of the label."""
    return analyze(label[:, :, None] + 0.5 * rng.normal(size=(SIZE, SIZE, 4)))


def margin_matrix(name):
    """Return M on the flattened grid: s(0) - s, or s itself."""
    identity = np.eye(SIZE**2)
    if name != 'coupled':
        return identity
    origin = np.zeros_like(identity)
    origin[:, 0] = 1
    return origin - identity


def targets(name, values, label):
    """Return q on the flattened grid after the slack step, sample by sample."""
    m, s = label.reshape(-1, 1), values.reshape(SIZE**2, -1)
    if name in CORE:
        slack = np.where(m >= CORE[name], 0.0, np.maximum(0, m - s))
        return m - slack
    loss, difference = 1 - m, s[:1] - s
    slack = np.maximum(0, difference - loss)
    return loss + slack


def test_label_is_a_periodic_gaussian():
    label = gaussian_label(41, (0.05, 0.08))
    t = np.arange(41) / 41
    axes = [sum(np.exp(-0.5 * ((t - p) / s)**2) for p in (-1, 0, 1, 2)) for s in (0.05, 0.08)]
    np.testing.assert_allclose(label, axes[0][:, None] * axes[1][None, :], atol=1e-6)
    assert label[0, 0] == 1 == label.max()


def test_label_falls_off_as_its_sigma_says():
    label = gaussian_label(51, (0.06, 0.1))
    assert label[3, 0] == pytest.approx(np.exp(-0.5 * (3 / 51 / 0.06)**2), abs=1e-6)
    assert label[0, 51 - 5] == pytest.approx(np.exp(-0.5 * (5 / 51 / 0.1)**2), abs=1e-6)


@pytest.mark.parametrize('name', LOSSES)
def test_normal_operator_is_that_of_the_matrix(backend, label, scores, name):
    loss = make_margin_loss(name, label, backend)
    matrix = margin_matrix(name)
    values = synthesize(scores, SIZE).reshape(SIZE**2, -1)
    expected = analyze((matrix.T @ matrix @ values).reshape(SIZE, SIZE, -1))
    np.testing.assert_allclose(loss.normal(scores), expected, atol=1e-12)


@pytest.mark.parametrize('name', LOSSES)
def test_normal_operator_is_self_adjoint(backend, rng, label, scores, name):
    loss = make_margin_loss(name, label, backend)
    other = analyze(rng.normal(size=(SIZE, SIZE, 4)))
    np.testing.assert_allclose(inner(loss.normal(scores), other),
                               inner(scores, loss.normal(other)), rtol=1e-10)
    assert np.all(inner(scores, loss.normal(scores)) >= 0)


def test_coupling_has_one_eigenvalue_as_large_as_the_grid(backend, label):
    loss = make_margin_loss('coupled', label, backend)
    ones = analyze(np.eye(1, SIZE**2).reshape(SIZE, SIZE, 1) * SIZE**2)
    ones[SIZE // 2, 0] = 0
    np.testing.assert_allclose(loss.normal(ones), SIZE**2 * ones, atol=1e-10)


@pytest.mark.parametrize('name', LOSSES)
def test_targets_are_those_of_the_slack_step(backend, label, scores, name):
    loss = make_margin_loss(name, label, backend)
    expected = margin_matrix(name).T @ targets(name, synthesize(scores, SIZE), label)
    np.testing.assert_allclose(loss.slack_targets(scores),
                               analyze(expected.reshape(SIZE, SIZE, -1)), atol=1e-12)


@pytest.mark.parametrize('name', LOSSES)
def test_losses_are_squared_hinges(backend, label, scores, name):
    loss = make_margin_loss(name, label, backend)
    s, m = synthesize(scores, SIZE), label[:, :, None]
    if name in CORE:
        expected = np.where(m >= CORE[name], (s - m)**2, np.maximum(0, s - m)**2)
    else:
        expected = np.maximum(0, (1 - m) - (s[:1, :1] - s))**2
    np.testing.assert_allclose(loss.losses(scores), expected.mean(axis=(0, 1)), rtol=1e-12)


@pytest.mark.parametrize('name', ['unit', 'coupled'])
def test_slack_step_is_optimal(backend, label, scores, name):
    # At the best slack, the squared distance of M s from its target is the hinge loss itself.
    loss = make_margin_loss(name, label, backend)
    values = synthesize(scores, SIZE).reshape(SIZE**2, -1)
    gap = margin_matrix(name) @ values - targets(name, values, label)
    np.testing.assert_allclose(loss.losses(scores), (gap**2).mean(axis=0), rtol=1e-12)


@pytest.mark.parametrize('name', ['unit', 'coupled'])
def test_perfect_scores_cost_nothing(backend, label, name):
    loss = make_margin_loss(name, label, backend)
    perfect = analyze(label[:, :, None])
    assert loss.losses(perfect)[0] == pytest.approx(0, abs=1e-20)
    np.testing.assert_allclose(loss.slack_targets(perfect), loss.normal(perfect), atol=1e-14)


def test_wider_margins_cost_nothing(backend, label):
    loss = make_margin_loss('coupled', label, backend)
    assert loss.losses(analyze(3 * label[:, :, None]))[0] == pytest.approx(0, abs=1e-20)


def test_only_the_coupled_anchor_mixes_frequencies(backend, label):
    mixes = [make_margin_loss(name, label, backend).couples_frequencies for name in LOSSES]
    assert mixes == [False, True, False]
