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
from scipy.io import savemat
import torch

from lmsco_ros.core.weights.formats import write_arrays


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
