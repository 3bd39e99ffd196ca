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
References written from the definitions, and scenes whose truth is known.

The references work with functions on a grid and explicit sums of exponentials; they share no
code with the half spectra of the tracker.
"""

from functools import cache, partial
from types import SimpleNamespace

import array_api_compat.numpy as numpy_namespace
import numpy as np
import pytest
import scipy.linalg
from scipy.special import erf

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.backend import Backend, limit_threads


@pytest.fixture(scope='session', autouse=True)
def single_thread():
    """Let small arrays be computed by one thread, whatever else the machine does."""
    limit_threads(1)


@pytest.fixture
def backend():
    """Return NumPy in double precision."""
    return Backend(numpy_namespace, 'cpu', 'float64')


@pytest.fixture
def rng():
    """Return a random generator that starts the same way in every test."""
    return np.random.default_rng(7)


class Band:
    """
    Real periodic functions with frequencies |ky|, |kx| <= `order`, on `size` x `size` points.

    Parameters
    ----------
    order : int
        Bandwidth K.
    size : int
        Points per axis.

    """

    def __init__(self, order, size):
        self.order, self.size = order, size
        t = np.arange(size) / size
        k = np.arange(-order, order + 1)
        waves = np.exp(2j * np.pi * np.outer(t, k))
        self.waves = np.einsum('ay,bx->abyx', waves, waves).reshape(size**2, -1)

    def values(self, series):
        """Return the function of a half spectrum by summing its whole spectrum."""
        count = 2 * self.order + 1
        full = np.zeros((count, count, *series.shape[2:]), complex)
        for ky in range(-self.order, self.order + 1):
            for kx in range(-self.order, self.order + 1):
                if kx >= 0:
                    full[ky + self.order, kx + self.order] = series[ky + self.order, kx]
                else:
                    full[ky + self.order, kx + self.order] = np.conj(
                        series[-ky + self.order, -kx])
        result = np.tensordot(self.waves, full.reshape(count**2, *series.shape[2:]), axes=1)
        assert np.abs(result.imag).max() < 1e-9 * (1 + np.abs(result).max())
        return result.real.reshape(self.size, self.size, *series.shape[2:])

    def series(self, values):
        """Return the half spectrum of the part of a function that lies in the band."""
        count = 2 * self.order + 1
        full = np.tensordot(self.waves.conj().T, values.reshape(self.size**2, *values.shape[2:]),
                            axes=1) / self.size**2
        return full.reshape(count, count, *values.shape[2:])[:, self.order:]

    def basis(self):
        """Return real functions, orthonormal in the mean over the grid, shape (N^2, d)."""
        columns = [np.ones(self.size**2)]
        count = 2 * self.order + 1
        for index in range(count**2 // 2 + 1, count**2):
            columns.append(np.sqrt(2) * self.waves[:, index].real)
            columns.append(np.sqrt(2) * self.waves[:, index].imag)
        return np.stack(columns, axis=1)

    def random(self, rng, *trailing):
        """Return the half spectrum of a random function."""
        return self.series(rng.normal(size=(self.size, self.size, *trailing)))


@pytest.fixture
def band():
    """Return a factory of bands, on the smallest grid that carries them unless told."""
    return lambda order, size=None: Band(order, size or 2 * order + 1)


def evaluate(series, ty, tx):
    """Return the value of a half spectrum at one point, frequency by frequency."""
    order = series.shape[1] - 1
    total = 0.0
    for ky in range(-order, order + 1):
        for kx in range(order + 1):
            wave = series[ky + order, kx] * np.exp(2j * np.pi * (ky * ty + kx * tx))
            total = total + (1 if kx == 0 else 2) * wave.real
    return total


@pytest.fixture(name='evaluate')
def evaluate_fixture():
    """Return the pointwise evaluation of a series."""
    return evaluate


def parabolic_window(target, minimum, edge, threshold, size):
    """
    Return gamma on a grid, and how many coefficients it keeps.

    The parabola is sampled on a fine grid, its DFT thresholded, and its minimum restored, as the
    definition says.
    """
    fine = 1024
    t = (np.arange(fine) + 0.5) / fine
    axes = [(edge - minimum) * (np.abs(t - 0.5) / (side / 2))**2 for side in target]
    # The window is a sum of two one-dimensional parabolas: so is its spectrum.
    k = np.arange(-40, 41)
    spectra = [np.array([np.mean(axis * np.exp(-2j * np.pi * f * t)) for f in k])
               for axis in axes]
    full = np.zeros((81, 81), complex)
    full[:, 40] += spectra[0]
    full[40, :] += spectra[1]
    full[40, 40] += minimum
    full[np.abs(full) < threshold * np.abs(full).max()] = 0
    waves = np.exp(2j * np.pi * np.outer(np.arange(240) / 240, k))
    trough = (waves @ full @ waves.T).real.min()
    full[40, 40] += minimum - trough
    waves = np.exp(2j * np.pi * np.outer(np.arange(size) / size, k))
    return (waves @ full @ waves.T).real, int(np.count_nonzero(full))


@pytest.fixture(name='parabolic_window')
def parabolic_window_fixture():
    """Return the spatial window by sampling, thresholding and restoring."""
    return parabolic_window


def dense_problem(blocks, weights, gamma, margin_weight):
    """
    Assemble the training problem on the grid from its definition.

    Parameters
    ----------
    blocks : list of (Band, ndarray (N, N, n, C))
        Band of each filter and values of its samples on the grid that all blocks share.
    weights : ndarray, shape (n,)
        Sample weights.
    gamma : ndarray, shape (F, F)
        Window on a grid fine enough for its products with the filters.
    margin_weight : float
        C.

    Returns
    -------
    namespace
        `scores` (n, N^2, d): filter coordinates to scores; `penalty` (d, d): G^T G; `pack` and
        `unpack`: half spectra to coordinates and back.

    """
    grams = [gram for space, samples in blocks
             for gram in [window_gram(space, gamma)] * samples.shape[3]]
    scores = np.concatenate([
        score_matrices(space, samples[..., channel])
        for space, samples in blocks for channel in range(samples.shape[3])], axis=2)
    return SimpleNamespace(
        scores=scores, penalty=scipy.linalg.block_diag(*grams), weights=np.asarray(weights),
        pack=partial(pack, blocks), unpack=partial(unpack, blocks), margin_weight=margin_weight)


def window_gram(space, gamma):
    """Return G^T G in the coordinates of a band."""
    fine = gamma.shape[0]
    wide = Band(space.order, fine).basis()
    product = wide.T @ (gamma.reshape(-1, 1) * wide) / fine**2
    return product.T @ product


def score_matrices(space, samples):
    """Return, for each sample (N, N, n) of a channel, coordinates to scores (n, N^2, d)."""
    basis = space.basis()
    return np.stack([convolution_matrix(samples[:, :, j]) @ basis
                     for j in range(samples.shape[2])])


def pack(blocks, filters):
    """Return the coordinates of half spectra."""
    return np.concatenate([
        space.basis().T @ space.values(block)[:, :, c].reshape(-1) / space.size**2
        for (space, _), block in zip(blocks, filters, strict=True)
        for c in range(block.shape[2])])


def unpack(blocks, coordinates):
    """Return the half spectra at coordinates."""
    filters, first = [], 0
    for space, samples in blocks:
        basis, channels = space.basis(), []
        for _ in range(samples.shape[3]):
            part = coordinates[first:first + basis.shape[1]]
            channels.append(space.series((basis @ part).reshape(space.size, space.size)))
            first += basis.shape[1]
        filters.append(np.stack(channels, axis=-1))
    return filters


def convolution_matrix(values):
    """Return the matrix of w -> mean_u z(t - u) w(u) on the grid of z."""
    size = values.shape[0]
    index = (np.arange(size)[:, None] - np.arange(size)[None, :]) % size
    matrix = values[index[:, None, :, None], index[None, :, None, :]]
    return matrix.reshape(size**2, size**2) / size**2


@pytest.fixture(name='dense_problem')
def dense_problem_fixture():
    """Return the assembly of a training problem from its definition."""
    return dense_problem


class Scene:
    """
    A textured warm target over a textured background, known at every point of the plane.

    Parameters
    ----------
    size : tuple of int
        Width and height in pixels.
    seed : int
        Seed of the textures.
    clutter : float
        Contrast of the background, in counts.

    """

    def __init__(self, size=(160, 128), seed=3, clutter=30.0):
        self.size, self.clutter = size, clutter
        rng = np.random.default_rng(seed)
        self._back = _waves(rng, 40, 0.03, 0.25)
        self._front = _waves(rng, 12, 0.5, 2.0)

    def render(self, center=None, target=(24.0, 18.0), pan=(0.0, 0.0), zoom=1.0):
        """Return the frame, in counts; without `center` the target is not there."""
        x, y = np.meshgrid(np.arange(self.size[0]) + 0.5, np.arange(self.size[1]) + 0.5)
        counts = 7000 + self.clutter * _sum(self._back, (x - pan[0]) / zoom, (y - pan[1]) / zoom)
        if center is not None:
            u, v = (x - center[0]) / target[0], (y - center[1]) / target[1]
            warm = 7500 + 80 * _sum(self._front, u, v)
            mask = _edge(x - center[0], target[0]) * _edge(y - center[1], target[1])
            counts = counts + mask * (warm - counts)
        return counts

    def frame(self, center=None, target=(24.0, 18.0), **camera):
        """Return the frame as a camera with 16 bits gives it."""
        return np.round(self.render(center, target, **camera)).astype(np.uint16)


def _waves(rng, count, low, high):
    """Return frequencies (x, y), phases and amplitudes of random plane waves."""
    radius, angle = rng.uniform(low, high, count), rng.uniform(0, 2 * np.pi, count)
    return (radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0, 2 * np.pi, count),
            rng.normal(size=count) * np.sqrt(2 / count))


def _sum(waves, x, y):
    """Return the sum of plane waves at points."""
    total = np.zeros_like(x)
    for fx, fy, phase, amplitude in zip(*waves, strict=True):
        total += amplitude * np.cos(2 * np.pi * (fx * x + fy * y) + phase)
    return total


def _edge(distance, width, blur=0.7):
    """Return the part of each pixel within width / 2 of the middle, seen through optics."""
    return (erf((width / 2 - distance) / (np.sqrt(2) * blur))
            + erf((width / 2 + distance) / (np.sqrt(2) * blur))) / 2


@pytest.fixture(scope='session')
def make_scene():
    """Return the factory of scenes."""
    return Scene


@pytest.fixture(scope='session')
def box_at():
    """Return the box of a scene's target."""
    return lambda center, target=(24.0, 18.0): BoundingBox.from_center(center, target)


def drawn(generator, name, shape, spread):
    """Return random numbers of an array; normalizations change the spread of nothing much."""
    numbers = generator.normal(0, spread, shape)
    if name.endswith(('norm.weight', 'running_var')):
        numbers = 0.5 + np.abs(numbers)
    return numbers.astype(np.float32)


@pytest.fixture(scope='session')
def random_network():
    """Return a function of a network class to a network with random weights, always the same."""
    def make(architecture, seed=5):
        generator = np.random.default_rng(seed)
        arrays = {}
        for name, shape in architecture.file_shapes().items():
            spread = (2 / np.prod(shape[1:]))**0.5 if len(shape) > 1 else 0.1
            arrays[name] = drawn(generator, name, shape, spread)
        return architecture.from_arrays(arrays)
    return make


@pytest.fixture
def random_weights(monkeypatch, random_network):
    """Let every name of the registry stand for its network with random weights."""
    from lmsco_ros.core.weights import store
    monkeypatch.setattr(store, 'load_backbone', lambda name, directory=None: random_network(
        store.find_source(name).architecture))


@pytest.fixture(scope='session')
def random_arrays():
    """Return a function of network class to arrays as a file of its weights holds them."""
    @cache
    def make(architecture):
        generator = np.random.default_rng(5)
        arrays = {}
        for name, shape in architecture.file_shapes().items():
            if name == 'mean':
                arrays[name] = np.array([90, 120, 140], np.float32)
            else:
                spread = (2 / np.prod(shape[1:]))**0.5 if len(shape) > 1 else 0.5
                arrays[name] = drawn(generator, name, shape, spread)
        return arrays
    return lambda architecture: dict(make(architecture))
