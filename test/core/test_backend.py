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

"""The same mathematics on NumPy arrays and torch tensors."""

import subprocess
import sys

import array_api_compat.numpy as numpy_namespace
import numpy as np
import pytest

from lmsco_ros.core.backend import Backend, irfft2, real_matmul, rfft2, select_backend, to_numpy
from lmsco_ros.core.config import (
    ChannelConfig, FeatureConfig, LearningConfig, RuntimeConfig, TrackerConfig)
from lmsco_ros.core.errors import ConfigError
from lmsco_ros.core.features.extractor import FeatureExtractor
from lmsco_ros.core.fourier.localization import centered_map, locate
from lmsco_ros.core.fourier.series import shift
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from lmsco_ros.core.weights.loading import Networks

TOLERANCE = {'float32': 1e-4, 'float64': 1e-9}
FEATURES = (FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity', 2.0)), cell=4),
            FeatureConfig((ChannelConfig('intensity', 0.5),), cell=8))


def torch_backend(dtype):
    """Return torch on the CPU."""
    torch_namespace = pytest.importorskip('array_api_compat.torch')
    import torch
    torch.set_num_threads(1)
    return Backend(torch_namespace, torch.device('cpu'), dtype)


def track_once(backend, learning):
    """Learn two patches and find a third: scores, filters, objective and peak."""
    rng = np.random.default_rng(5)
    patch = rng.normal(size=(72, 72)).astype(np.float32)
    extractor = FeatureExtractor(TrackerConfig(features=FEATURES), Networks(), 72, backend)
    samples = extractor(np.stack([patch, np.roll(patch, (4, -8), axis=(0, 1))]))
    sample = [block[:, :, 0] for block in samples]
    operator = StructuredOperator(learning, sample, (0.2, 0.25), backend)
    operator.remember([shift(block, (0.01, -0.02)) for block in sample])
    operator.train()
    scores = operator.scores(samples)
    peak = locate(scores[:, :, 1:], 21, 5)
    return ([to_numpy(block) for block in operator.filters], to_numpy(scores),
            operator.objective(), peak)


@pytest.mark.parametrize('dtype', ['float32', 'float64'])
@pytest.mark.parametrize('loss', ['unit', 'coupled', 'ridge'])
def test_torch_gives_the_result_of_numpy(dtype, loss):
    learning = LearningConfig(
        loss=loss, margin_weight=1.0, label_sigma=0.1,
        window_minimum=0.05, window_edge=0.2, memory_size=3, learning_rate=0.1,
        initial_iterations=4, iterations=2, gradient_steps=2)
    results = [track_once(backend, learning) for backend in (
        Backend(numpy_namespace, 'cpu', dtype), torch_backend(dtype))]
    filters, scores, objective, peak = results[0]
    other, torch_scores, torch_objective, torch_peak = results[1]
    tolerance = TOLERANCE[dtype]
    for block, torch_block in zip(filters, other, strict=True):
        assert torch_block.dtype == block.dtype
        np.testing.assert_allclose(torch_block, block, atol=tolerance * np.abs(block).max())
    np.testing.assert_allclose(torch_scores, scores, atol=tolerance * np.abs(scores).max())
    assert torch_objective == pytest.approx(objective, rel=10 * tolerance)
    assert torch_peak.displacement == pytest.approx(peak.displacement, abs=tolerance)
    np.testing.assert_allclose(torch_peak.grid, peak.grid,
                               atol=tolerance * np.abs(peak.grid).max())
    assert centered_map(torch_peak.grid).dtype == np.float32


@pytest.mark.parametrize('dtype', ['float32', 'float64'])
def test_running_precision_is_kept(dtype):
    backend = Backend(numpy_namespace, 'cpu', dtype)
    patch = np.random.default_rng(5).normal(size=(36, 36)).astype(np.float32)
    config = TrackerConfig(features=FEATURES[:1])
    block, = FeatureExtractor(config, Networks(), 36, backend)(patch[None])
    operator = StructuredOperator(LearningConfig(initial_iterations=2), [block[:, :, 0]],
                                  (0.2, 0.2), backend)
    assert block.dtype == operator.filters[0].dtype == backend.complex
    assert operator.scores([block]).dtype == backend.complex


@pytest.mark.parametrize('make', [lambda d: Backend(numpy_namespace, 'cpu', d), torch_backend])
@pytest.mark.parametrize('dtype', ['float32', 'float64'])
def test_real_times_complex(rng, make, dtype):
    backend = make(dtype)
    matrix = rng.normal(size=(4, 6))
    values = rng.normal(size=(3, 6, 5)) + 1j * rng.normal(size=(3, 6, 5))
    moved = backend.namespace.asarray(values, dtype=backend.complex)
    result = to_numpy(real_matmul(backend.asarray(matrix), moved))
    assert result.dtype == {'float32': np.complex64, 'float64': np.complex128}[dtype]
    np.testing.assert_allclose(result, matrix @ values, atol=TOLERANCE[dtype])
    flat = to_numpy(real_matmul(backend.asarray(matrix), moved[0]))
    np.testing.assert_allclose(flat, matrix @ values[0], atol=TOLERANCE[dtype])


@pytest.mark.parametrize('make', [lambda d: Backend(numpy_namespace, 'cpu', d), torch_backend])
@pytest.mark.parametrize('size', [8, 9])
def test_transforms_are_inverse(rng, make, size):
    values = rng.normal(size=(size, size, 3))
    spectrum = rfft2(make('float64').asarray(values))
    np.testing.assert_allclose(to_numpy(spectrum)[:, :size // 2 + 1],
                               np.fft.fft2(values, axes=(0, 1))[:, :size // 2 + 1], atol=1e-11)
    np.testing.assert_allclose(to_numpy(irfft2(spectrum[:, :size // 2 + 1], size)), values,
                               atol=1e-12)


def test_cpu_means_numpy():
    backend = select_backend('cpu')
    assert backend.namespace is numpy_namespace
    assert backend.asarray([1, 2]).dtype == np.float32
    assert backend.complex == np.complex64


@pytest.mark.parametrize('name', ['cuda', 'cuda:1', 'tpu', 'gpu', ''])
def test_missing_devices_are_refused(monkeypatch, name):
    torch = pytest.importorskip('torch')
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    with pytest.raises(ConfigError, match='not available here; use "cpu"'):
        select_backend(name)


def test_missing_device_of_a_configuration_is_refused(monkeypatch):
    from lmsco_ros.core import LMSCOTracker
    torch = pytest.importorskip('torch')
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    with pytest.raises(ConfigError, match='cuda'):
        LMSCOTracker(TrackerConfig(runtime=RuntimeConfig(device='cuda')))


def test_core_needs_neither_ros_nor_torch():
    code = ('import sys\n'
            'import lmsco_ros.core\n'
            'from lmsco_ros.core import LMSCOTracker, TrackerConfig\n'
            'LMSCOTracker(TrackerConfig())\n'
            'print(sorted({"rclpy", "torch", "sensor_msgs", "std_msgs", "msg_adapters", '
            '"rosbags", "typer"} & set(sys.modules)))\n')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          timeout=100)
    assert (done.stdout.strip(), done.returncode) == ('[]', 0), done.stderr
