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

"""Every published format gives back what was written, and damaged files are refused."""

import os
import struct
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from scipy.io import savemat
import torch

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.weights import caffe_format
from lmsco_ros.core.weights.formats import (
    declared_arrays, read_about, read_arrays, write_arrays)


@pytest.fixture
def arrays(rng):
    """Return the arrays of a small network with groups and with sizes of 1."""
    shapes = {'conv1': (4, 3, 7, 5), 'conv2': (6, 2, 3, 3), 'last/part': (1, 6, 1, 1)}
    result = {}
    for name, shape in shapes.items():
        result[f'{name}.weight'] = rng.normal(size=shape).astype(np.float32)
        result[f'{name}.bias'] = rng.normal(size=shape[0]).astype(np.float32)
    return result


def test_what_is_written_is_read(file_format, arrays, write_file):
    found = read_arrays(write_file(file_format, arrays))
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array, err_msg=name)


def test_views_are_written_as_they_look(tmp_path, rng):
    array = rng.normal(size=(4, 3, 5, 5)).astype(np.float32)[:, ::-1, 1:, ::2]
    write_arrays(tmp_path / 'view.safetensors', {'view': array}, {})
    np.testing.assert_array_equal(read_arrays(tmp_path / 'view.safetensors')['view'], array)


@pytest.mark.parametrize('kind', ['matconvnet', 'old matconvnet'])
def test_matconvnet_tells_the_mean_of_each_channel(kind, arrays, write_file):
    mean = np.array([120.5, 110.25, 100], np.float32)
    found = read_arrays(write_file(kind, {**arrays, 'mean': mean}))
    np.testing.assert_allclose(found['mean'], mean)


def test_mean_may_be_a_column(tmp_path):
    cells = np.empty((1, 1), object)
    cells[0, 0] = {'name': 'c', 'weights': np.zeros((1, 0), object)}
    network = {'layers': cells,
               'meta': {'normalization': {'averageImage': [[123.0], [117.0], [104.0]]}}}
    savemat(tmp_path / 'network.mat', {'net': network})
    found = read_arrays(tmp_path / 'network.mat')
    np.testing.assert_array_equal(found['mean'], [123, 117, 104])


@pytest.mark.parametrize('part', [0.0, 0.05, 0.3, 0.8, 0.999])
def test_truncated_files_are_refused(file_format, part, arrays, write_file):
    whole = write_file(file_format, arrays).read_bytes()
    path = write_file(file_format, arrays, stem='truncated')
    path.write_bytes(whole[:int(part * len(whole))])
    with pytest.raises(WeightsError, match=f'{path}.*(again|damaged|no layer|state)'):
        read_arrays(path)


def test_files_of_something_else_are_refused(file_format, arrays, write_file, rng):
    path = write_file(file_format, arrays)
    path.write_bytes(rng.bytes(5000))
    with pytest.raises(WeightsError, match=str(path)):
        read_arrays(path)


def test_unknown_suffix_is_told_with_the_known(tmp_path):
    with pytest.raises(WeightsError, match=r'weights\.onnx.*\.safetensors, \.npz, .*\.caffemodel'):
        read_arrays(tmp_path / 'weights.onnx')


def test_changed_numbers_are_noticed(tmp_path, arrays):
    path = tmp_path / 'changed.safetensors'
    write_arrays(path, arrays, {'source': 'a test'})
    assert read_about(path)['source'] == 'a test'
    content = bytearray(path.read_bytes())
    content[-10] ^= 1
    path.write_bytes(content)
    with pytest.raises(WeightsError, match='damaged'):
        read_arrays(path)


class Trap:
    """Something that runs a command when it is unpickled carelessly."""

    def __init__(self, mark):
        self._mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self._mark),)


def test_code_in_files_is_not_run(tmp_path):
    mark = tmp_path / 'it-ran'
    torch.save({'conv1.weight': Trap(mark)}, tmp_path / 'trap.pth')
    np.savez(tmp_path / 'trap.npz', weight=np.array([Trap(mark)], object))
    for name, reason in (('trap.pth', 'more than tensors'), ('trap.npz', 'allow_pickle')):
        with pytest.raises(WeightsError, match=reason):
            read_arrays(tmp_path / name)
    assert not mark.exists()


def test_a_checkpoint_without_a_state_dictionary_is_refused(tmp_path):
    torch.save([torch.zeros(3)], tmp_path / 'list.pth')
    with pytest.raises(WeightsError, match='holds a list; expected a state dictionary'):
        read_arrays(tmp_path / 'list.pth')


def test_other_matlab_files_are_refused_with_a_remedy(tmp_path):
    savemat(tmp_path / 'other.mat', {'layer': 1.0})
    with pytest.raises(WeightsError, match='no variable `layers`; expected .* MatConvNet'):
        read_arrays(tmp_path / 'other.mat')
    newer = tmp_path / 'newer.mat'
    newer.write_bytes(b'MATLAB 7.3 MAT-file'.ljust(124) + b'\x00\x02IM' + bytes(500))
    with pytest.raises(WeightsError, match='save it with the option -v7'):
        read_arrays(newer)


def test_missing_file_is_told_as_such(file_format, arrays, write_file):
    path = write_file(file_format, arrays)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        read_arrays(path)


def test_half_a_conversion_leaves_nothing(tmp_path, arrays):
    path = tmp_path / 'folder' / 'weights.safetensors'
    with pytest.raises(TypeError):
        write_arrays(path, arrays, {'number': 3})
    assert list(path.parent.iterdir()) == []


MANY = 40_000_000
"""Numbers of a bomb, which a careless reader would unfold to 160 MB."""


def npz_bomb(path):
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        with archive.open('conv1.weight.npy', 'w') as file:
            np.lib.format.write_array_header_1_0(
                file, {'descr': '<f4', 'fortran_order': False, 'shape': (MANY,)})
            for _ in range(40):
                file.write(bytes(4 * MANY // 40))


def compressed_torch_bomb(path):
    whole = path.with_suffix('.whole')
    torch.save({'conv1.weight': torch.zeros(1)}, whole)
    with zipfile.ZipFile(whole) as given, \
            zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name in given.namelist():
            content = given.read(name)
            archive.writestr(name, bytes(4 * MANY) if name.endswith('data/0') else content)


class Expanding:
    """Pickled as a byte array of many zeros."""

    def __reduce__(self):
        return bytearray, (4 * MANY,)


def element(kind, content):
    """Return an element of a MATLAB file."""
    return struct.pack('<II', kind, len(content)) + content + bytes(-len(content) % 8)


def matlab_array(array_class, dimensions, rest=b''):
    """Return a variable `layers` of a MATLAB file."""
    return element(14, element(6, struct.pack('<II', array_class, 0))
                   + element(5, struct.pack(f'<{len(dimensions)}i', *dimensions))
                   + element(1, b'layers') + rest)


def write_matlab(path, *variables):
    path.write_bytes(b'MATLAB 5.0 MAT-file'.ljust(124) + b'\x00\x01IM' + b''.join(variables))


def compressed(variable):
    content = zlib.compress(variable)
    return struct.pack('<II', 15, len(content)) + content


def nested(depth):
    variable = matlab_array(6, (0, 0), element(9, b''))
    for _ in range(depth):
        variable = matlab_array(1, (1, 1), variable)
    return variable


# Names of one letter: a file of 20 kB declares 20,000 structures with as many fields.
FIELDS = element(5, struct.pack('<i', 1)) + element(1, b'a' * 20_000)
BOMBS = {
    'zeros.npz': npz_bomb,
    'zeros.pth': compressed_torch_bomb,
    'bytes.pth': lambda path: torch.save({'conv1.weight': Expanding()}, path),
    'old_bytes.pth': lambda path: torch.save(
        {'conv1.weight': Expanding()}, path, _use_new_zipfile_serialization=False),
    'expanded.pt': lambda path: torch.save(
        {'w': torch.zeros(1, dtype=torch.half).expand(MANY)}, path),
    'zeros.mat': lambda path: write_matlab(
        path, compressed(matlab_array(7, (MANY, 1), element(7, bytes(4 * MANY))))),
    'cells.mat': lambda path: write_matlab(path, matlab_array(1, (MANY, 10))),
    'structures.mat': lambda path: write_matlab(path, matlab_array(2, (20_000, 1), FIELDS)),
    'text.mat': lambda path: write_matlab(path, matlab_array(4, (MANY, 1), element(4, b''))),
    'negative.mat': lambda path: write_matlab(path, matlab_array(1, (-MANY, -2))),
    'lying.mat': lambda path: write_matlab(path, struct.pack('<II', 14, 8)
                                           + matlab_array(1, (MANY, 10))[8:]),
    'deep.mat': lambda path: write_matlab(path, nested(2000)),
}


@pytest.mark.parametrize('name', BOMBS)
def test_bombs_are_refused_before_they_unfold(tmp_path, name):
    path = tmp_path / name
    BOMBS[name](path)
    assert path.stat().st_size < 1_000_000
    tracemalloc.start()
    try:
        with pytest.raises(WeightsError, match=f'{path}.*(get it again|save network.state_dict)'):
            read_arrays(path, 10_000_000)
        assert tracemalloc.get_traced_memory()[1] < 60_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize('name', ['zeros.pth', 'bytes.pth', 'old_bytes.pth'])
def test_checkpoints_are_refused_before_pytorch_reads_them(tmp_path, monkeypatch, name):
    BOMBS[name](tmp_path / name)
    monkeypatch.setattr(torch, 'load', lambda *args, **kwargs: pytest.fail('it was read'))
    with pytest.raises(WeightsError):
        read_arrays(tmp_path / name, 10_000_000)


def test_matlab_files_of_too_many_parts_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr('lmsco_ros.core.weights.matlab_file._MOST_PARTS', 9)
    cells = matlab_array(1, (4, 1), matlab_array(6, (0, 0), element(9, b'')) * 4)
    write_matlab(tmp_path / 'many.mat', cells, compressed(cells))
    with pytest.raises(WeightsError, match='more than 9 parts'):
        read_arrays(tmp_path / 'many.mat')
    write_matlab(tmp_path / 'few.mat', cells)
    with pytest.raises(WeightsError, match='damaged, or no MATLAB file with a network'):
        read_arrays(tmp_path / 'few.mat')


@pytest.mark.parametrize('array_class, flags, numbers', [
    (6, 0, 0), (6, 0x800, 1), (4, 0, 0), (5, 0, 2), (5, 0x800, 3)])
def test_matlab_arrays_without_their_numbers_are_refused(tmp_path, array_class, flags, numbers):
    # SciPy takes the next array for the numbers, and the process crashes.
    lacking = matlab_array(array_class | flags, (0, 0), element(9, b'') * numbers)
    write_matlab(tmp_path / 'lacking.mat', matlab_array(1, (4, 1), lacking * 4))
    with pytest.raises(WeightsError, match='an array lacks its numbers'):
        read_arrays(tmp_path / 'lacking.mat')


def test_files_beyond_the_limit_are_refused(file_format, arrays, write_file):
    path = write_file(file_format, arrays)
    size = sum(array.nbytes for array in arrays.values())
    with pytest.raises(WeightsError, match=f'{path} holds .*more than the'):
        read_arrays(path, size)
    assert read_arrays(path, 40 * size).keys() == arrays.keys()


def test_archive_declares_its_arrays_before_they_are_read(tmp_path):
    npz_bomb(tmp_path / 'zeros.npz')
    (name, array), = declared_arrays(tmp_path / 'zeros.npz').items()
    assert (name, array.shape, array.dtype, array.base.nbytes) == (
        'conv1.weight', (MANY,), np.float32, 4)
    assert declared_arrays(tmp_path / 'other.mat') is None


def test_sparse_tensors_and_types_of_other_libraries_are_refused(tmp_path):
    from safetensors.torch import save_file
    torch.save({'w': torch.eye(3).to_sparse()}, tmp_path / 'sparse.pth')
    save_file({'w': torch.zeros(3, dtype=torch.bfloat16)}, tmp_path / 'half.safetensors')
    for name, reason in (('sparse.pth', 'more than tensors'), ('half.safetensors', 'bfloat16')):
        with pytest.raises(WeightsError, match=reason):
            read_arrays(tmp_path / name)


def test_other_members_of_an_archive_are_left_out(tmp_path):
    np.savez(tmp_path / 'weights.npz', weight=np.ones(3))
    with zipfile.ZipFile(tmp_path / 'weights.npz', 'a') as archive:
        archive.writestr('README', 'about the weights')
    assert list(read_arrays(tmp_path / 'weights.npz')) == ['weight']
    assert list(declared_arrays(tmp_path / 'weights.npz')) == ['weight']


def test_negative_shapes_are_refused(tmp_path):
    network = caffe_format._network_message()()
    blob = network.layer.add(name='conv1').blobs.add(data=[1.0] * 6)
    blob.shape.dim.extend((-3, -2))
    (tmp_path / 'negative.caffemodel').write_bytes(network.SerializeToString())
    with pytest.raises(WeightsError, match=r'6 numbers for the shape \(-3, -2\)'):
        read_arrays(tmp_path / 'negative.caffemodel')
