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

"""Networks computed slowly from their definitions, and files of weights in every format."""

import numpy as np
import pytest


def convolve(features, weight, bias, stride=1, padding=0, groups=1):
    """Return the convolution of features (C, H, W), summing over each kernel's elements."""
    features = np.pad(features, ((0, 0), (padding,) * 2, (padding,) * 2))
    out, inside, height, width = weight.shape
    rows = (features.shape[1] - height) // stride + 1
    columns = (features.shape[2] - width) // stride + 1
    result = np.zeros((out, rows, columns)) + bias[:, None, None]
    share = out // groups
    for group in range(groups):
        given = features[group * inside:(group + 1) * inside]
        to = slice(group * share, (group + 1) * share)
        for y in range(height):
            for x in range(width):
                seen = given[:, y:y + rows * stride:stride, x:x + columns * stride:stride]
                result[to] += np.einsum('oi,iyx->oyx', weight[to, :, y, x],
                                        seen[:, :rows, :columns])
    return result


def pool(features):
    """Return the maxima over 3x3 windows at every second position, also incomplete windows."""
    channels, height, width = features.shape
    rows, columns = -(-(height - 3) // 2) + 1, -(-(width - 3) // 2) + 1
    result = np.empty((channels, rows, columns))
    for i, j in np.ndindex(rows, columns):
        result[:, i, j] = features[:, 2 * i:2 * i + 3, 2 * j:2 * j + 3].max(axis=(1, 2))
    return result


def normalize(features, k, alpha, beta=0.75, size=5):
    """Return the features, each divided by the energy of its neighbor channels."""
    result = np.empty_like(features)
    for c in range(len(features)):
        near = features[max(0, c - size // 2):c + size // 2 + 1]
        result[c] = features[c] / (k + alpha * (near**2).sum(axis=0))**beta
    return result


def relu(features):
    """Return the features without the negative ones."""
    return np.maximum(features, 0)


def layer(features, arrays, name, **geometry):
    """Return a convolution, rectified."""
    return relu(convolve(features, arrays[f'{name}.weight'].astype(float),
                         arrays[f'{name}.bias'].astype(float), **geometry))


def color(image, mean):
    """Return what a color network was trained to see of a gray image (1, H, W) of 0..1."""
    return np.repeat(255 * image, 3, axis=0) - mean[:, None, None]


def vgg_m(image, arrays):
    """Return all layers of VGG-M."""
    found = {}
    found['conv1'] = normalize(layer(color(image, arrays['mean']), arrays, 'conv1', stride=2),
                               2, 1e-4)
    found['conv2'] = normalize(layer(pool(found['conv1']), arrays, 'conv2', stride=2, padding=1),
                               2, 1e-4)
    found['conv3'] = layer(pool(found['conv2']), arrays, 'conv3', padding=1)
    found['conv4'] = layer(found['conv3'], arrays, 'conv4', padding=1)
    found['conv5'] = layer(found['conv4'], arrays, 'conv5', padding=1)
    return found


def motion_cnn(image, arrays):
    """Return all layers of the motion network; its pictures begin with the magnitude."""
    image = image[::-1] - arrays['mean'][:, None, None]
    found = {}
    found['conv1'] = normalize(pool(layer(image, arrays, 'conv1', stride=2)), 1, 1e-4 / 5)
    found['conv2'] = normalize(
        pool(layer(found['conv1'], arrays, 'conv2', stride=2, groups=2)), 1, 1e-4 / 5)
    found['conv3'] = layer(found['conv2'], arrays, 'conv3', padding=1)
    found['conv4'] = layer(found['conv3'], arrays, 'conv4', padding=1, groups=2)
    found['conv5'] = layer(found['conv4'], arrays, 'conv5', padding=1, groups=2)
    return found


def squeezenet(image, arrays):
    """Return all layers of SqueezeNet."""
    found = {'conv1': layer(color(image, arrays['mean']), arrays, 'conv1', stride=2)}
    features = found['conv1']
    for number in range(2, 9):
        name = f'fire{number}'
        if number in (2, 5):
            features = pool(features)
        narrow = layer(features, arrays, f'{name}.squeeze')
        features = np.concatenate([layer(narrow, arrays, f'{name}.expand1'),
                                   layer(narrow, arrays, f'{name}.expand3', padding=1)])
        found[name] = features
    return found


def normalized(features, arrays, name, epsilon, padding=(0, 0), **geometry):
    """Return a convolution without bias of a file, on padded features, and its normalization."""
    features = np.pad(features, ((0, 0), padding, padding))
    weight = arrays[f'{name}.weight'].astype(float)
    result = convolve(features, weight, np.zeros(len(weight)), **geometry)
    factor, shift, mean, variance = (
        arrays[f'{name}.norm.{part}'].astype(float)[:, None, None]
        for part in ('weight', 'bias', 'running_mean', 'running_var'))
    return factor * (result - mean) / np.sqrt(variance + epsilon) + shift


def relu6(features):
    """Return the features, limited to 0..6."""
    return np.clip(features, 0, 6)


def inverted_residuals(image, arrays, groups, epsilon, zeros, deviation):
    """
    Return all layers of a network of inverted residuals.

    `groups` are (expansion, channels, number, stride, kernel) as the papers list them; `zeros`
    gives the padding before and behind for a kernel and a stride.
    """
    seen = color(image, arrays['mean']) / np.array(deviation)[:, None, None]
    features = relu6(normalized(seen, arrays, 'conv1', epsilon, stride=2))
    found = {'conv1': features}
    for expansion, channels, number, first_stride, kernel in groups:
        for stride in [first_stride] + [1] * (number - 1):
            name, given = f'block{len(found)}', features
            if expansion > 1:
                features = relu6(normalized(features, arrays, f'{name}.expand', epsilon))
            features = relu6(normalized(
                features, arrays, f'{name}.depthwise', epsilon, zeros(kernel, stride),
                stride=stride, groups=len(features)))
            features = normalized(features, arrays, f'{name}.project', epsilon)
            if stride == 1 and len(given) == channels:
                features = features + given
            found[name] = features
    return found


def mobilenet_v2(image, arrays):
    """Return all layers of MobileNetV2, table 2 of its paper; padded as by torchvision."""
    groups = ((1, 16, 1, 1, 3), (6, 24, 2, 2, 3), (6, 32, 3, 2, 3), (6, 64, 4, 2, 3),
              (6, 96, 3, 1, 3))
    deviation = 255 * np.array([0.229, 0.224, 0.225])
    return inverted_residuals(image, arrays, groups, 1e-5, lambda kernel, stride: (1, 1),
                              deviation)


def efficientnet_lite0(image, arrays):
    """Return all layers of EfficientNet-Lite0, table 1 of its paper; padded as by TensorFlow."""
    groups = ((1, 16, 1, 1, 3), (6, 24, 2, 2, 3), (6, 40, 2, 2, 5), (6, 80, 3, 2, 3),
              (6, 112, 3, 1, 5))
    zeros = {(3, 1): (1, 1), (3, 2): (0, 1), (5, 1): (2, 2), (5, 2): (1, 2)}
    return inverted_residuals(image, arrays, groups, 1e-3,
                              lambda *geometry: zeros[geometry], [128.0] * 3)


@pytest.fixture(scope='session')
def slow_layers():
    """Return a function of network class, image (C, H, W) and arrays of a file to all layers."""
    slow = {'VGGM': vgg_m, 'MotionCNN': motion_cnn, 'SqueezeNet': squeezenet,
            'MobileNetV2': mobilenet_v2, 'EfficientNetLite0': efficientnet_lite0}
    return lambda architecture, image, arrays: slow[architecture.__name__](image, arrays)
