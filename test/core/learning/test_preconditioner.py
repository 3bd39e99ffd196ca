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

"""The preconditioners against dense inverses."""

import numpy as np
import pytest

from lmsco_ros.core.backend import Backend, to_numpy
from lmsco_ros.core.fourier.series import analyze, inner
from lmsco_ros.core.learning.memory import SampleMemory
from lmsco_ros.core.learning.preconditioner import CoupledPreconditioner, FrequencyPreconditioner

SHAPES = [(7, 4, 3), (5, 3, 2)]
MARGIN_WEIGHT, WINDOW_ENERGY = 3.0, 0.2
KINDS = [FrequencyPreconditioner, CoupledPreconditioner]


def random_blocks(rng):
    """Return random real functions."""
    return [analyze(rng.normal(size=(s[0], s[0], s[2]))) for s in SHAPES]


@pytest.fixture
def samples(rng):
    """Return samples that look alike."""
    common = random_blocks(rng)
    return [[c + 0.3 * b for c, b in zip(common, random_blocks(rng), strict=True)]
            for _ in range(3)]


@pytest.fixture
def memory(backend, samples):
    memory = SampleMemory(5, 0.1, SHAPES, backend)
    for sample in samples:
        memory.add(sample)
    return memory


def averages(memory, samples, index):
    """Return the weighted mean and the weighted energy of a block."""
    stacked = np.stack([sample[index] for sample in samples])
    return (np.tensordot(memory.weights, stacked, axes=1),
            np.tensordot(memory.weights, np.abs(stacked)**2, axes=1))


def dot(left, right):
    """Return the inner product of two filters."""
    return sum(float(np.sum(inner(a, b))) for a, b in zip(left, right, strict=True))


@pytest.mark.parametrize('kind', KINDS)
def test_symmetric_and_positive_definite(memory, rng, kind):
    preconditioner = kind(memory, MARGIN_WEIGHT, WINDOW_ENERGY)
    for _ in range(5):
        one, other = random_blocks(rng), random_blocks(rng)
        assert dot(preconditioner.apply(one), other) == pytest.approx(
            dot(one, preconditioner.apply(other)), rel=1e-9)
        assert dot(one, preconditioner.apply(one)) > 0


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('library', ['numpy', 'torch'])
def test_right_hand_side_and_memory_are_left_alone(samples, rng, kind, library):
    namespace = pytest.importorskip(f'array_api_compat.{library}')
    memory = SampleMemory(5, 0.1, SHAPES, Backend(namespace, 'cpu', 'float64'))
    for sample in samples:
        memory.add([namespace.asarray(block) for block in sample])
    blocks = [namespace.asarray(block) for block in random_blocks(rng)]
    kept = [to_numpy(b).copy() for b in [*blocks, *memory.mean, *memory.energy]]
    kind(memory, MARGIN_WEIGHT, WINDOW_ENERGY).apply(blocks)
    for before, after in zip(kept, [*blocks, *memory.mean, *memory.energy], strict=True):
        np.testing.assert_array_equal(before, to_numpy(after))


def test_frequencies_are_inverted_one_by_one(memory, samples, rng):
    blocks = random_blocks(rng)
    solved = FrequencyPreconditioner(memory, MARGIN_WEIGHT, WINDOW_ENERGY).apply(blocks)
    for i, (block, result) in enumerate(zip(blocks, solved, strict=True)):
        mean, energy = averages(memory, samples, i)
        for ky, kx in np.ndindex(block.shape[:2]):
            z, e = mean[ky, kx], energy[ky, kx]
            matrix = np.diag(MARGIN_WEIGHT * (e - np.abs(z)**2) + WINDOW_ENERGY).astype(complex)
            matrix += MARGIN_WEIGHT * np.outer(z.conj(), z)
            np.testing.assert_allclose(result[ky, kx], np.linalg.solve(matrix, block[ky, kx]),
                                       rtol=1e-9, atol=1e-12)


def test_one_sample_and_a_constant_window_are_inverted_exactly(backend, rng):
    # Then the normal operator is |gamma|^2 + C conj(z) z^T at each frequency, nothing else.
    shape = SHAPES[0]
    memory = SampleMemory(1, 0.1, [shape], backend)
    memory.add([analyze(rng.normal(size=(shape[0], shape[0], shape[2])))])
    wanted = analyze(rng.normal(size=(shape[0], shape[0], shape[2])))
    image, = memory.adjoint(memory.forward([wanted]))
    right = MARGIN_WEIGHT * image + WINDOW_ENERGY * wanted
    result, = FrequencyPreconditioner(memory, MARGIN_WEIGHT, WINDOW_ENERGY).apply([right])
    np.testing.assert_allclose(result, wanted, atol=1e-10)


def test_coupled_inverse_has_one_direction_over_all_frequencies(memory, samples, rng, band):
    parts = [averages(memory, samples, i) for i in range(2)]
    spaces = [band(s[1] - 1) for s in SHAPES]

    def coordinates(blocks):
        return np.concatenate([
            (space.basis().T @ space.values(b).reshape(-1, b.shape[2]) / space.size**2).T.ravel()
            for space, b in zip(spaces, blocks, strict=True)])

    # The energy of k and of -k is the same: it scales a cosine and its sine alike.
    diagonal = []
    direction = []
    for space, (mean, energy) in zip(spaces, parts, strict=True):
        basis = space.basis()
        swing = space.values(mean)
        swing = swing - swing.mean(axis=(0, 1))
        for c in range(mean.shape[2]):
            waves = np.stack([space.series(w.reshape(space.size, -1)) for w in basis.T])
            power = np.abs(waves)**2 * np.where(np.arange(waves.shape[2]) == 0, 1, 2)
            diagonal.append(np.sum(power * energy[None, :, :, c], axis=(1, 2)))
            # The score of the mean sample at the origin: mean_u z(-u) w(u).
            mirrored = np.roll(swing[::-1, ::-1, c], (1, 1), axis=(0, 1)).reshape(-1)
            direction.append(basis.T @ mirrored / space.size**2)
    u = np.concatenate(direction)
    matrix = np.diag(MARGIN_WEIGHT * np.concatenate(diagonal) + WINDOW_ENERGY)
    matrix += MARGIN_WEIGHT * np.outer(u, u)
    blocks = random_blocks(rng)
    solved = CoupledPreconditioner(memory, MARGIN_WEIGHT, WINDOW_ENERGY).apply(blocks)
    np.testing.assert_allclose(coordinates(solved), np.linalg.solve(matrix, coordinates(blocks)),
                               atol=1e-10)
