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

from functools import cache

import numpy as np
import pytest
from scipy.io import savemat
import torch

from lmsco_ros.core.backbones.formats import write_arrays


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


@pytest.fixture(scope='session')
def slow_layers():
    """Return a function of network class, image (C, H, W) and arrays of a file to all layers."""
    slow = {'VGGM': vgg_m, 'MotionCNN': motion_cnn, 'SqueezeNet': squeezenet}
    return lambda architecture, image, arrays: slow[architecture.__name__](image, arrays)


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
                arrays[name] = generator.normal(0, spread, shape).astype(np.float32)
        return arrays
    return lambda architecture: dict(make(architecture))


def layers_of(arrays):
    """Return {layer: (kernels, biases)}."""
    return {name.removesuffix('.weight'): (array, arrays[name.replace('.weight', '.bias')])
            for name, array in arrays.items() if name.endswith('.weight')}


def matconvnet_layer(name, kernels, bias, modern):
    """Return a layer as MATLAB structures hold it."""
    kernels, bias = kernels.transpose(2, 3, 1, 0), bias.reshape(-1, 1)
    if not modern:
        return {'name': name, 'type': 'conv', 'filters': kernels, 'biases': bias}
    weights = np.empty((1, 2), object)
    weights[0, 0], weights[0, 1] = kernels, bias
    return {'name': name, 'type': 'conv', 'weights': weights, 'stride': [[1.0, 1.0]]}


def write_matconvnet(path, arrays, modern):
    """Write a network of MatConvNet with layers without weights between the others."""
    layers = []
    for name, (kernels, bias) in layers_of(arrays).items():
        layers += [matconvnet_layer(name, kernels, bias, modern),
                   {'name': f'relu_{name}', 'type': 'relu'}]
    cells = np.empty((1, len(layers)), object)
    cells[0, :] = layers
    content = {'layers': cells}
    if 'mean' in arrays:
        picture = np.broadcast_to(arrays['mean'], (4, 5, 3)).copy()
        picture[0] += 1
        picture[1] -= 1
        normalization = {'averageImage': picture, 'imageSize': [[4.0, 5.0, 3.0]]}
        content |= {'meta': {'normalization': normalization}} if modern \
            else {'normalization': normalization}
    savemat(path, content)


def varint(number):
    """Return a number as the wire format of protocol buffers writes it."""
    low, rest = number & 127, number >> 7
    return bytes([low | 128]) + varint(rest) if rest else bytes([low])


def field(number, value):
    """Return a field of a message: a number, or the bytes of anything longer."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    return varint(number << 3 | 2) + varint(len(value)) + value


def caffe_blob(array, modern):
    """Return an array with its shape, old or new, and a gradient that nobody needs."""
    if modern:
        shape = field(7, field(1, b''.join(map(varint, array.shape))))
    else:
        sizes = (1,) * (4 - array.ndim) + array.shape
        shape = b''.join(field(number + 1, size) for number, size in enumerate(sizes))
    return shape + field(5, array.astype('<f4').tobytes()) + field(6, bytes(8))


def write_caffe(path, arrays, modern):
    """
    Write a network of Caffe, byte by byte, with a layer without arrays.

    The numbers of the fields are those of its published definition: layers 100 with name 1,
    type 2 and blobs 7; before, layers 2 with name 4, type 5 and blobs 6.
    """
    layer, name_field, type_field, blobs = (100, 1, 2, 7) if modern else (2, 4, 5, 6)
    kind = b'Convolution' if modern else 4
    content = field(1, b'net') + field(layer, field(name_field, b'data'))
    for name, pair in layers_of(arrays).items():
        content += field(layer, field(name_field, name.encode()) + field(type_field, kind)
                         + b''.join(field(blobs, caffe_blob(array, modern)) for array in pair))
    path.write_bytes(content)


def write_torch(path, arrays, nested):
    """Write a state dictionary, alone or inside a checkpoint."""
    state = {name: torch.from_numpy(array) for name, array in arrays.items()}
    torch.save({'epoch': 3, 'state_dict': state} if nested else state, path)


WRITERS = {
    'matconvnet': ('.mat', lambda path, arrays: write_matconvnet(path, arrays, True)),
    'old matconvnet': ('.mat', lambda path, arrays: write_matconvnet(path, arrays, False)),
    'caffe': ('.caffemodel', lambda path, arrays: write_caffe(path, arrays, True)),
    'old caffe': ('.caffemodel', lambda path, arrays: write_caffe(path, arrays, False)),
    'state': ('.pth', lambda path, arrays: write_torch(path, arrays, False)),
    'checkpoint': ('.pt', lambda path, arrays: write_torch(path, arrays, True)),
    'numpy': ('.npz', lambda path, arrays: np.savez(path, **arrays)),
    'safetensors': ('.safetensors', lambda path, arrays: write_arrays(path, arrays, {})),
}


@pytest.fixture(params=WRITERS)
def file_format(request):
    """Return the name of each format in turn."""
    return request.param


@pytest.fixture
def write_file(tmp_path):
    """Return a function that writes arrays in a format and returns the file."""
    def write(kind, arrays, stem='published'):
        suffix, writer = WRITERS[kind]
        path = tmp_path / f'{stem}{suffix}'
        writer(path, arrays)
        return path
    return write
