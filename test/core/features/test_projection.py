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

"""Principal components against a singular value decomposition."""

import array_api_compat.numpy as numpy_namespace
import array_api_compat.torch as torch_namespace
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
import torch

from lmsco_ros.core.backend import Backend, to_numpy
from lmsco_ros.core.features.projection import principal_components, Projection

NUMPY = Backend(numpy_namespace, 'cpu')
TORCH = Backend(torch_namespace, torch.device('cpu'))


def channels(rng, count, cells=7, samples=1):
    """Return correlated channels with a mean, of very different strength."""
    mixture = rng.normal(size=(count, count)) * np.logspace(0, -2, count)[:, None]
    return ((rng.normal(size=(samples, cells, cells, count)) + 0.3) @ mixture).astype(np.float32)


@pytest.mark.parametrize('count', [1, 3, 8])
def test_components_are_the_strongest_singular_vectors(rng, count):
    given = channels(rng, 8)
    matrix = principal_components(given, count)
    assert matrix.shape == (8, count) and matrix.dtype == np.float32
    assert matrix.flags.c_contiguous
    _, strengths, vectors = np.linalg.svd(given.reshape(-1, 8).astype(float))
    np.testing.assert_allclose(np.abs(np.sum(matrix * vectors[:count].T, axis=0)), 1, atol=1e-5)
    kept = np.sum((given.reshape(-1, 8) @ matrix)**2, axis=0)
    np.testing.assert_allclose(kept, strengths[:count]**2, rtol=1e-4)


@given(values=arrays(np.float32, (3, 4, 5), elements=st.floats(-100, 100, width=32)),
       count=st.integers(1, 9))
def test_no_other_directions_keep_more(values, count):
    matrix = principal_components(values, count).astype(float)
    assert matrix.shape == (5, min(count, 5))
    np.testing.assert_allclose(matrix.T @ matrix, np.eye(matrix.shape[1]), atol=1e-6)
    rows = values.reshape(-1, 5).astype(float)
    strengths = np.linalg.svd(rows, compute_uv=False)**2
    kept = np.sum((rows @ matrix)**2)
    assert kept == pytest.approx(strengths[:count].sum(), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize('backend', [NUMPY, TORCH], ids=['numpy', 'torch'])
def test_projection_is_learned_from_the_first_sample_that_is_not_zero(rng, backend):
    first, second = channels(rng, 6, samples=2), channels(rng, 6)
    projection = Projection(3, backend)
    silent = projection(backend.asarray(np.zeros_like(second)))
    assert silent.shape == (1, 7, 7, 3) and not to_numpy(silent).any()
    matrix = principal_components(first, 3)
    for sample in (first, second, np.zeros_like(first), first):
        projected = projection(backend.asarray(sample))
        assert isinstance(projected, type(backend.asarray(sample)))
        assert to_numpy(projected).dtype == np.float32
        np.testing.assert_allclose(to_numpy(projected), sample @ matrix, rtol=1e-5, atol=1e-5)


def test_more_components_than_channels_keep_all(rng):
    sample = channels(rng, 4)
    projected = Projection(9, NUMPY)(sample)
    assert projected.shape == sample.shape
    np.testing.assert_allclose(np.sum(projected**2, axis=-1), np.sum(sample**2, axis=-1),
                               rtol=1e-4)
