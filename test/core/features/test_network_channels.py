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

"""Layers of networks as channels: where the cells lie, how they are averaged, what is refused."""

import copy

import array_api_compat.numpy as numpy_namespace
import array_api_compat.torch as torch_namespace
import numpy as np
import pytest
import torch

from lmsco_ros.core.backend import Backend
from lmsco_ros.core.errors import ConfigError
from lmsco_ros.core.features.network_channels import NetworkChannels
from lmsco_ros.core.networks.efficientnet_lite import EfficientNetLite0
from lmsco_ros.core.networks.inverted_residual import InvertedResidual
from lmsco_ros.core.networks.layers import LocalResponseNorm
from lmsco_ros.core.networks.mobilenet_v2 import MobileNetV2
from lmsco_ros.core.networks.motion_cnn import MotionCNN
from lmsco_ros.core.networks.squeezenet import SqueezeNet
from lmsco_ros.core.networks.thermal import ThermalFlowNet, ThermalNet
from lmsco_ros.core.networks.vgg_m import VGGM

NUMPY = Backend(numpy_namespace, 'cpu')
NETWORKS = [(ThermalNet, 'appearance', 'features', 4), (ThermalFlowNet, 'motion', 'features', 4),
            (VGGM, 'appearance', 'conv5', 16), (VGGM, 'appearance', 'conv1', 4),
            (SqueezeNet, 'appearance', 'fire5', 8), (MotionCNN, 'motion', 'conv5', 16),
            (MobileNetV2, 'appearance', 'block6', 8),
            (EfficientNetLite0, 'appearance', 'block3', 4)]


def inputs(rng, kind, count, size):
    """Return random patches or flow images."""
    if kind == 'motion':
        return rng.uniform(0, 255, (count, size, size, 3)).astype(np.float32)
    return rng.uniform(-0.2, 1.2, (count, size, size)).astype(np.float32)


@pytest.mark.parametrize('architecture, kind, layer, cell', NETWORKS)
def test_a_shift_by_a_cell_shifts_the_map(rng, random_network, architecture, kind, layer, cell):
    cells = 15
    size = cells * cell
    # On a torus both views have the same contrast, which is taken out of appearance.
    scene = inputs(rng, kind, 1, size)
    moved = np.roll(scene, (-cell, -cell), axis=(1, 2))
    run = NetworkChannels(random_network(architecture), kind, [(layer, cell)], size, NUMPY)
    here, there = (run(view)[layer, cell][0] for view in (scene, moved))
    assert here.shape == (cells, cells, run.channels(layer)) and here.dtype == np.float32
    # Away from the border, whose pixels are repeated.
    inner = slice(6, 8)
    assert np.abs(here[inner, inner] - there[inner, inner]).max() > 0.1 * np.abs(here).max()
    np.testing.assert_allclose(there[inner, inner], here[7:9, 7:9],
                               atol=1e-4 * np.abs(here).max())


@pytest.mark.parametrize('architecture, kind, layer, cell', NETWORKS)
def test_several_are_answered_together_as_each_alone(rng, random_network, architecture, kind,
                                                     layer, cell):
    run = NetworkChannels(random_network(architecture), kind, [(layer, cell)], 6 * cell, NUMPY)
    several = [inputs(rng, kind, count, 6 * cell) for count in (1, 3, 2)]
    for given, told in zip(several, run.together(several), strict=True):
        alone = run(given)
        assert told.keys() == alone.keys()
        np.testing.assert_allclose(told[layer, cell], alone[layer, cell],
                                   atol=1e-5 * np.abs(alone[layer, cell]).max())
    np.testing.assert_array_equal(run.together(several[:1])[0][layer, cell],
                                  run(several[0])[layer, cell])


def test_only_those_who_give_the_same_are_asked_together(random_network):
    network = random_network(ThermalNet)

    def make(network=network, requests=(('features', 4),), size=80):
        return NetworkChannels(network, 'appearance', requests, size, NUMPY).whom
    others = [make(random_network(ThermalNet)), make(requests=[('features', 8)]), make(size=96)]
    assert make() == make() and make() not in others
    # A copy asks the network that was copied with it.
    first, second = copy.deepcopy([NetworkChannels(network, 'appearance', [('features', 4)], 80,
                                                   NUMPY) for _ in range(2)])
    assert first.whom == second.whom != make()


def position_network(architecture, random_network):
    """Return a network each of whose cells answers a ramp with the middle of what it sees."""
    network = random_network(architecture)
    for module in network.modules():
        if isinstance(module, torch.nn.Conv2d):
            module.weight.data.fill_(1 / module.weight[0].numel())
            module.bias.data.zero_()
    network._prepare = lambda images: images
    for block in (part for part in network.modules() if isinstance(part, InvertedResidual)):
        block.shortcut, block.rectify = False, torch.nn.ReLU()
    plain = {torch.nn.MaxPool2d: torch.nn.AvgPool2d(3, 2, ceil_mode=True, count_include_pad=False),
             LocalResponseNorm: torch.nn.Identity(), torch.nn.ReLU6: torch.nn.ReLU()}
    network.stages = {name: [plain.get(type(module), module) for module in stage]
                      for name, stage in getattr(network, 'stages', {}).items()}
    return network


@pytest.mark.parametrize('axis', [1, 2])
@pytest.mark.parametrize('architecture, kind', [
    (ThermalNet, 'appearance'), (ThermalFlowNet, 'motion'), (VGGM, 'appearance'),
    (SqueezeNet, 'appearance'), (MotionCNN, 'motion'), (MobileNetV2, 'appearance'),
    (EfficientNetLite0, 'appearance')])
def test_cells_look_at_their_own_squares(random_network, architecture, kind, axis):
    """To within half a cell of the layer, whatever margin the network needs."""
    network, size = position_network(architecture, random_network), 208
    cells = {name: layer.stride for name, layer in network.layers.items()}
    run = NetworkChannels(network, kind, cells.items(), size, NUMPY)
    shape = inputs(np.random.default_rng(3), kind, 1, size).shape
    ramp = np.moveaxis(np.zeros(shape, np.float32), axis, -1) + np.arange(size) + 0.5
    maps = run(np.ascontiguousarray(np.moveaxis(ramp, -1, axis).astype(np.float32)))
    for name, cell in cells.items():
        middle = size // cell // 2
        seen = maps[name, cell][0, middle, middle].mean()
        assert abs(seen - (middle + 0.5) * cell) <= cell / 2 + 0.01, name


def test_cells_are_averages_of_the_layer(rng, random_network):
    network, size = random_network(ThermalNet), 96
    patches = inputs(rng, 'appearance', 2, size)
    maps = NetworkChannels(network, 'appearance', [('conv1', 2), ('conv1', 8), ('conv1', 24)],
                           size, NUMPY)(patches)
    layer, = network(torch.from_numpy(patches)[:, None], ['conv1'])
    layer = layer.permute(0, 2, 3, 1).numpy()
    np.testing.assert_array_equal(maps['conv1', 2], layer)
    for cell in (8, 24):
        count, each = size // cell, cell // 2
        expected = np.zeros((2, count, count, 24))
        for i, j in np.ndindex(count, count):
            expected[:, i, j] = layer[:, i * each:(i + 1) * each,
                                      j * each:(j + 1) * each].mean(axis=(1, 2), dtype=float)
        np.testing.assert_allclose(maps['conv1', cell], expected, rtol=1e-5, atol=1e-6)


def test_all_requests_come_from_one_pass(rng, random_network):
    network, size = random_network(VGGM), 64
    requests = [('deep', 16), ('shallow', 4), ('conv1', 4), ('conv3', 32), ('shallow', 2),
                ('deep', 16)]
    ran = []
    for name, module in network.named_modules():
        if isinstance(module, torch.nn.Conv2d):
            module.register_forward_hook(lambda *_, name=name: ran.append(name))
    run = NetworkChannels(network, 'appearance', iter(requests), size, NUMPY)
    maps = run(inputs(rng, 'appearance', 3, size))
    assert ran == ['conv1', 'conv2', 'conv3', 'conv4', 'conv5']
    assert {request: found.shape for request, found in maps.items()} == {
        (layer, cell): (3, size // cell, size // cell, 96 if cell < 16 else 512)
        for layer, cell in requests}
    np.testing.assert_array_equal(maps['shallow', 4], maps['conv1', 4])
    assert run.channels('shallow') == 96 and run.channels('deep') == 512
    ran.clear()
    NetworkChannels(network, 'appearance', [('shallow', 8)], size, NUMPY)(
        inputs(rng, 'appearance', 1, size))
    assert ran == ['conv1']


def test_channels_of_torch_are_those_of_numpy(rng, random_network):
    network, patches = random_network(ThermalNet), inputs(rng, 'appearance', 2, 48)
    on_torch = Backend(torch_namespace, torch.device('cpu'))
    one, other = (NetworkChannels(network, 'appearance', [('deep', 8)], 48, backend)(patches)
                  for backend in (NUMPY, on_torch))
    moved = on_torch.asarray(other['deep', 8])
    assert isinstance(moved, torch.Tensor) and moved.dtype == torch.float32
    np.testing.assert_array_equal(moved.numpy(), one['deep', 8])


@pytest.mark.parametrize('architecture, kind, words', [
    (ThermalFlowNet, 'appearance', 'appearance_backbone names a ThermalFlowNet, which takes 3 '
                                   'channels; expected a network of 1: intensities'),
    (ThermalNet, 'motion', 'motion_backbone names a ThermalNet, which takes 1 channels; '
                           'expected a network of 3: flow images')])
def test_network_of_the_other_kind_is_refused(random_network, architecture, kind, words):
    with pytest.raises(ConfigError, match=words):
        NetworkChannels(random_network(architecture), kind, [('deep', 4)], 64, NUMPY)


@pytest.mark.parametrize('layer, cell, words', [
    ('conv9', 4, "ThermalNet has no layer 'conv9'; expected one of shallow, deep, conv1, "),
    ('features', 6, 'FeatureConfig.cell is 6, but layer features of ThermalNet has cells of 4 '
                    'pixels; expected a multiple of 4'),
    ('deep', 2, 'cell is 2, but layer features .* a multiple of 4')])
def test_layers_and_cells_that_do_not_fit_are_refused(random_network, layer, cell, words):
    with pytest.raises(ConfigError, match=words):
        NetworkChannels(random_network(ThermalNet), 'appearance', [(layer, cell)], 96, NUMPY)
