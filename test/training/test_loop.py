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

"""The loop on a problem whose answer is known: what it writes, and that it learns."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file
import torch

from lmsco_ros.core.networks.thermal import ThermalNet
from lmsco_ros.core.weights.formats import read_arrays
from lmsco_ros.core.weights.registry import find_source
from lmsco_ros.core.weights.store import fitting_arrays
from training.loop import Batch, Schedule, take, train

SCHEDULE = Schedule(minutes=1e6, steps=60, learning_rate=0.1, weight_decay=0.0, log_interval=20,
                    device='cpu')
TRUTH = torch.tensor([0.7, -1.2, 0.4])


class Squares:
    """Squared error of a linear network; right is what is less than a tenth off."""

    def __call__(self, network, batch):
        return (network(batch.inputs) - batch.targets).square().mean()

    def accuracy(self, network, batch):
        return float(((network(batch.inputs) - batch.targets).abs() < 0.1).float().mean())


def batches(seed):
    """Yield examples of a linear function without end."""
    generator = torch.Generator().manual_seed(seed)
    while True:
        inputs = torch.randn(16, 3, generator=generator)
        yield Batch(inputs, (inputs @ TRUTH)[:, None])


def run(folder, schedule=SCHEDULE, seed=1):
    """Train a linear network and return it with the rows of its log."""
    torch.manual_seed(seed)
    network = torch.nn.Linear(3, 1)
    train(network, Squares(), batches(seed), take(batches(99), 3), schedule, folder / 'toy')
    with (folder / 'toy_log.csv').open(encoding='utf-8') as stream:
        return network, list(csv.DictReader(stream))


def test_loop_learns_and_writes_weights_and_log(tmp_path):
    network, rows = run(tmp_path / 'new' / 'folder')
    assert [int(row['step']) for row in rows] == [0, 20, 40, 60]
    assert rows[0]['training_loss'] == '' and float(rows[0]['validation_loss']) > 0.5
    assert float(rows[-1]['validation_loss']) < 0.01 * float(rows[0]['validation_loss'])
    assert float(rows[-1]['training_loss']) < float(rows[1]['training_loss'])
    assert float(rows[-1]['validation_accuracy']) > 0.9 > float(rows[0]['validation_accuracy'])
    np.testing.assert_allclose(network.weight.detach()[0], TRUTH, atol=0.05)
    assert not network.training
    written = load_file(tmp_path / 'new' / 'folder' / 'toy.safetensors')
    assert set(written) == {'weight', 'bias'}
    np.testing.assert_array_equal(written['weight'], network.weight.detach())


def test_same_seed_gives_the_same_weights(tmp_path):
    one, again, other = (run(tmp_path, seed=seed)[0] for seed in (1, 1, 2))
    assert one.weight.equal(again.weight) and not one.weight.equal(other.weight)


def test_time_ends_the_training(tmp_path):
    _, rows = run(tmp_path, replace(SCHEDULE, minutes=1e-9))
    assert [int(row['step']) for row in rows] == [0]
    assert (tmp_path / 'toy.safetensors').exists()


def test_learning_rate_rises_shortly_and_falls_to_nothing(tmp_path, monkeypatch):
    from training import loop
    rates, step = [], loop._step

    def spy(network, objective, optimizer, batch, rate):
        rates.append(rate)
        return step(network, objective, optimizer, batch, rate)
    monkeypatch.setattr(loop, '_step', spy)
    run(tmp_path, replace(SCHEDULE, steps=100))
    assert len(rates) == 100
    assert rates[0] == pytest.approx(0.05 * 0.1) and max(rates) <= 0.1
    assert max(rates) in rates[1:4] and rates[-1] < 1e-4
    assert all(later < earlier for earlier, later in zip(rates[3:], rates[4:], strict=False))


def test_a_source_that_fails_ends_the_training(tmp_path):
    def broken():
        yield from take(batches(1), 2)
        raise ValueError('no more examples')
    with pytest.raises(ValueError, match='no more examples'):
        train(torch.nn.Linear(3, 1), Squares(), broken(), [], SCHEDULE, tmp_path / 'toy')


def test_trained_weights_are_those_of_a_backbone(tmp_path):
    """What the loop writes is what the tracker reads."""
    class Anything:
        def __call__(self, network, batch):
            return network(batch.inputs, ['features'])[0].square().mean()

        def accuracy(self, network, batch):
            return 0.0
    torch.manual_seed(3)
    network = ThermalNet()
    images = torch.rand(2, 1, 20, 20)
    batch = Batch(images, torch.zeros(2, 1))
    train(network, Anything(), iter([batch] * 4), [batch], replace(SCHEDULE, steps=2),
          tmp_path / 'thermal')
    path = tmp_path / 'thermal.safetensors'
    arrays = fitting_arrays(find_source('thermal'), read_arrays(path), path)
    loaded = ThermalNet.from_arrays(arrays)
    expected, = network(images, ['features'])
    torch.testing.assert_close(loaded(images, ['features'])[0], expected.detach(), rtol=1e-4,
                               atol=1e-5)
