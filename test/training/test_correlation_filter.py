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

"""The differentiable filter against a dense solution, the tracker's own, and its definition."""

import array_api_compat.numpy as numpy_namespace
import numpy as np
import pytest
import torch

from lmsco_ros.core.backend import Backend
from lmsco_ros.core.config import LearningConfig
from lmsco_ros.core.fourier.series import analyze, synthesize
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from training.correlation_filter import CorrelationFilter, margin_loss
from training.features import FeatureObjective
from training.loop import Batch

FACTOR, SIGMA, MINIMUM, EDGE = 4.0, 0.3, 0.01, 0.03


@pytest.fixture(scope='module', autouse=True)
def single_thread():
    """Let small arrays be computed by one thread."""
    torch.set_num_threads(1)


@pytest.fixture
def rng():
    """Return a random generator that starts the same way in every test."""
    return np.random.default_rng(7)


def correlation(steps):
    """Return a filter."""
    return CorrelationFilter(FACTOR, SIGMA, MINIMUM, EDGE, steps)


def slow_label(cells, shift):
    """Return the label point by point."""
    sigma = max(SIGMA / FACTOR, 0.6 / cells)
    label = np.zeros((cells, cells))
    for row, column in np.ndindex(cells, cells):
        away = [(index / cells - moved + 0.5) % 1 - 0.5
                for index, moved in ((row, shift[1]), (column, shift[0]))]
        label[row, column] = np.exp(-0.5 * (away[0]**2 + away[1]**2) / sigma**2)
    return label


def slow_window(cells):
    """
    Return the window point by point.

    The filter is a function of (label position - feature position): the label is at index 0, the
    middle of the patch at index (cells - 1) / 2.
    """
    window = np.zeros((cells, cells))
    for row, column in np.ndindex(cells, cells):
        total = 0.0
        for index in (row, column):
            seen = -index % cells  # where the feature is that index speaks of
            away = (seen - (cells - 1) / 2) / cells
            total += (2 * FACTOR * away)**2
        window[row, column] = MINIMUM + (EDGE - MINIMUM) * total
    return window


def slow_maps(maps):
    """Return normalized, windowed maps (..., C, N, N)."""
    cells = maps.shape[-1]
    hann = np.sin(np.pi * np.arange(1, cells + 1) / (cells + 1))**2
    energy = np.mean(maps**2, axis=(-3, -2, -1), keepdims=True)
    return maps / np.sqrt(energy + 1e-6) * hann[:, None] * hann[None, :]


def dense_filter(maps, label, window):
    """Return the minimum of the problem, w on the grid, shape (C, N, N), by least squares."""
    count, channels, cells, _ = maps.shape
    index = (np.arange(cells)[:, None] - np.arange(cells)[None, :]) % cells
    rows = []
    for sample in slow_maps(maps):
        blocks = [values[index[:, None, :, None], index[None, :, None, :]].reshape(
            cells**2, cells**2) / cells**2 for values in sample]
        rows.append(np.concatenate(blocks, axis=1) / np.sqrt(count))
    rows.append(np.diag(np.tile(window.ravel(), channels)))
    wanted = np.concatenate([np.tile(label.ravel(), count) / np.sqrt(count),
                             np.zeros(channels * cells**2)])
    solution = np.linalg.lstsq(np.concatenate(rows), wanted, rcond=None)[0]
    return solution.reshape(channels, cells, cells)


@pytest.mark.parametrize('cells', [7, 8, 25])
@pytest.mark.parametrize('shift', [(0.0, 0.0), (0.2, -0.35), (0.5, 0.1)])
def test_label_has_its_peak_at_the_shift(cells, shift):
    label = correlation(1).label(cells, torch.tensor([shift, (0.0, 0.0)], dtype=torch.float64))
    assert label.shape == (2, cells, cells)
    np.testing.assert_allclose(label[0], slow_label(cells, shift), atol=1e-12)
    np.testing.assert_allclose(label[1], slow_label(cells, (0, 0)), atol=1e-12)
    assert label[1, 0, 0] == 1
    row, column = np.unravel_index(int(label[0].argmax()), (cells, cells))
    for index, moved in ((row, shift[1]), (column, shift[0])):
        assert abs((index / cells - moved + 0.5) % 1 - 0.5) <= 0.5 / cells + 1e-9


@pytest.mark.parametrize('cells', [7, 8, 25])
def test_window_is_lowest_where_the_filter_speaks_of_the_target(cells):
    window = correlation(1).window(cells).numpy()
    np.testing.assert_allclose(window, slow_window(cells), rtol=1e-4)
    middle = (cells + 1) // 2
    assert window.min() == pytest.approx(window[middle, middle], rel=1e-5)
    assert window.min() < 2.1 * MINIMUM < 0.1 * window.max()


@pytest.mark.parametrize('cells, samples', [(7, 1), (7, 3), (8, 2)])
def test_many_steps_reach_the_dense_solution(rng, cells, samples):
    maps = rng.normal(size=(2, samples, 2, cells, cells))
    solver = correlation(300)
    spectra = solver.prepare(torch.from_numpy(maps))
    np.testing.assert_allclose(
        spectra, np.fft.rfft2(slow_maps(maps)) / cells**2, atol=1e-12)
    filters = solver.train(spectra)
    scores = solver.scores(spectra[:, 0], filters)
    for target in range(2):
        expected = dense_filter(maps[target], slow_label(cells, (0, 0)), slow_window(cells))
        found = np.fft.irfft2(filters[target].numpy() * cells**2, s=(cells, cells))
        np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())
        sample = slow_maps(maps[target, 0])
        slow = np.zeros((cells, cells))
        for row, column in np.ndindex(cells, cells):
            rows, columns = (row - np.arange(cells)) % cells, (column - np.arange(cells)) % cells
            slow[row, column] = np.sum(sample[:, rows[:, None], columns] * expected) / cells**2
        np.testing.assert_allclose(scores[target], slow, atol=1e-4)


def test_few_steps_lower_the_objective_further_and_further(rng):
    maps = rng.normal(size=(1, 2, 3, 7, 7))
    label, window = slow_label(7, (0, 0)), slow_window(7)
    objectives = []
    for steps in (0, 1, 2, 4, 8, 16):
        solver = correlation(steps)
        spectra = solver.prepare(torch.from_numpy(maps))
        filters = solver.train(spectra)
        values = np.fft.irfft2(filters[0].numpy() * 49, s=(7, 7))
        errors = [np.mean((solver.scores(spectra[:, j], filters)[0].numpy() - label)**2)
                  for j in range(2)]
        objectives.append(np.mean(np.sum((window * values)**2, axis=0)) + np.mean(errors))
    assert all(after < before for before, after in zip(objectives, objectives[1:], strict=False))
    assert objectives[-1] < 0.5 * objectives[0]


def test_filter_is_about_that_of_the_tracker(rng):
    """The tracker's filters have a band instead of a grid: the same problem at its borders."""
    cells = 25
    target = rng.normal(size=(4, 5, 5))
    maps = 0.3 * rng.normal(size=(1, 1, 4, cells, cells))
    maps[0, 0, :, 10:15, 10:15] += target
    solver = CorrelationFilter(5.0, 1 / 12, 0.005, 0.01, 400)
    spectra = solver.prepare(torch.from_numpy(maps))
    scores = solver.scores(spectra[:, 0], solver.train(spectra))[0].numpy()
    order = (cells - 1) // 2
    half_a_cell = np.exp(-1j * np.pi * np.arange(-order, order + 1) / cells)
    sample = analyze(np.moveaxis(slow_maps(maps[0, 0]), 0, -1))
    sample = sample * (half_a_cell[:, None] * half_a_cell[None, order:])[:, :, None]
    learning = LearningConfig(loss='ridge', label_sigma=0.6 / cells * 5, window_minimum=0.005,
                              window_edge=0.01, window_sparsity=0.0, initial_iterations=100,
                              gradient_steps=5)
    operator = StructuredOperator(learning, [sample], (0.2, 0.2),
                                  Backend(numpy_namespace, 'cpu', 'float64'))
    own = synthesize(operator.scores([sample[:, :, None]]), cells)[:, :, 0]
    assert scores[0, 0] == scores.max() > 0.5
    np.testing.assert_allclose(own, scores, atol=0.15)
    assert own[0, 0] == pytest.approx(scores[0, 0], abs=0.03)
    assert np.corrcoef(own.ravel(), scores.ravel())[0, 1] > 0.97


def test_loss_counts_excess_everywhere_and_lack_on_the_core(rng):
    scores, label = rng.normal(0.3, 0.5, (3, 5, 5)), rng.uniform(0, 1, (3, 5, 5))
    expected = np.zeros(3)
    for target, row, column in np.ndindex(3, 5, 5):
        gap = scores[target, row, column] - label[target, row, column]
        if gap > 0 or label[target, row, column] >= 0.6:
            expected[target] += gap**2 / np.sum(label[target]**2)
    found = margin_loss(torch.from_numpy(scores), torch.from_numpy(label), 0.6)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize('cells', [5, 6])
def test_gradient_flows_through_training_and_search(rng, cells):
    maps = torch.from_numpy(rng.normal(size=(3, 2, cells, cells))).requires_grad_()
    solver = correlation(3)
    label = solver.label(cells, torch.tensor([[0.2, -0.1]], dtype=torch.float64))

    def loss(maps):
        spectra = solver.prepare(maps)
        filters = solver.train(spectra[None, :2])
        return margin_loss(solver.scores(spectra[2:], filters), label, 0.5)
    assert torch.autograd.gradcheck(loss, (maps,), eps=1e-6, atol=1e-6)
    gradient, = torch.autograd.grad(loss(maps).sum(), maps)
    assert (gradient.abs().amax(dim=(1, 2, 3)) > 1e-4).all()


def test_everything_stays_on_the_device_and_in_the_precision_of_the_features():
    """On a device without memory, where an array of another device is an error."""
    solver = correlation(2)
    for dtype in (torch.float32, torch.float64):
        maps = torch.zeros(2, 3, 4, 7, 7, dtype=dtype, device='meta')
        spectra = solver.prepare(maps)
        scores = solver.scores(spectra[:, 0], solver.train(spectra))
        label = solver.label(7, maps.new_zeros(2, 2))
        loss = margin_loss(scores, label, 0.5)
        assert {tensor.device.type for tensor in (scores, label, loss)} == {'meta'}
        assert {tensor.dtype for tensor in (scores, label, loss)} == {dtype}


class Pixels(torch.nn.Module):
    """A network that shows its input."""

    def forward(self, images, layers):
        return [images]


def test_objective_finds_targets_where_the_offsets_say(rng):
    cells, factor = 25, 5.0
    objective = FeatureObjective(CorrelationFilter(factor, 1 / 12, 0.02, 0.06, 8), 'pixels', 0.5)
    views, targets = [], []
    for _ in range(4):
        ground, target = 0.1 * rng.normal(size=(3, cells, cells)), rng.normal(size=(5, 5))
        moved = rng.integers(-4, 5, 2)
        places = [(0, 0), (0, 0), moved]
        for view, (right, down) in zip(ground, places, strict=True):
            view[10 + down:15 + down, 10 + right:15 + right] += 2 * target
        views.append(ground[:, None])
        # In sides of the region over the factor.
        targets.append([(*(np.array(place) / cells * factor), 0, 0) for place in places])
    batch = Batch(torch.from_numpy(np.array(views, np.float32)),
                  torch.from_numpy(np.array(targets, np.float32)))
    elsewhere = Batch(batch.inputs, batch.targets + 3 / cells * factor)
    assert objective.accuracy(Pixels(), batch) == 1
    assert objective.accuracy(Pixels(), elsewhere) == 0
    assert objective(Pixels(), batch) < 0.5 * objective(Pixels(), elsewhere)
