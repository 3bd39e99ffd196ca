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

"""Arrays of the files that networks are published in, read without running anything in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import hashlib
import os
from pathlib import Path
import pickle

import numpy as np
from safetensors import safe_open, SafetensorError
from safetensors.numpy import load_file, save_file
import torch

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.weights.caffe_format import read_caffemodel
from lmsco_ros.core.weights.matconvnet_format import read_matconvnet

__all__ = ['READERS', 'read_about', 'read_arrays', 'write_arrays']

Arrays = dict[str, np.ndarray]

_DIGEST = 'arrays_sha256'


def read_arrays(path: Path) -> Arrays:
    """
    Return the arrays of a file under the names that the file gives them.

    Parameters
    ----------
    path : Path
        Its suffix tells the format, see `READERS`.

    Raises
    ------
    WeightsError
        When the format is not known, or the file is damaged.

    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise WeightsError(f'{path}: the suffix does not tell the format; expected one of '
                           f'{", ".join(READERS)}')
    return reader(path)


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray],
                 about: Mapping[str, str]) -> None:
    """
    Write arrays to a safetensors file, all or nothing.

    Parameters
    ----------
    path : Path
        Its folder is made where it is missing.
    arrays : mapping of str to ndarray
        What `read_arrays` will give back, and will find damaged when it has changed.
    about : mapping of str to str
        What `read_about` will tell.

    """
    # The library writes the memory of an array, whatever its strides.
    arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f'{path.name}.{os.getpid()}.part')
    try:
        save_file(arrays, partial, {**about, _DIGEST: _digest(arrays)})
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def read_about(path: Path) -> dict[str, str]:
    """Return what a safetensors file tells about itself; files of other formats tell nothing."""
    if path.suffix.lower() != '.safetensors':
        return {}
    try:
        with safe_open(path, 'numpy') as file:
            return file.metadata() or {}
    except SafetensorError as error:
        raise _damaged(path, 'safetensors', error) from error


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """Return a checksum of the names, types, shapes and values of arrays."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        digest.update(f'{name} {array.dtype.str} {array.shape}\n'.encode())
        digest.update(array.data)
    return digest.hexdigest()


def _damaged(path: Path, kind: str, reason: object) -> WeightsError:
    """Return the error of a file that is not what its suffix says."""
    return WeightsError(f'{path} is damaged, or no {kind} file ({reason}); get it again')


def _read_safetensors(path: Path) -> Arrays:
    """Return the arrays of a safetensors file; those of `write_arrays` are seen to be whole."""
    try:
        arrays = load_file(path)
    except SafetensorError as error:
        raise _damaged(path, 'safetensors', error) from error
    written = read_about(path).get(_DIGEST)
    if written is not None and written != _digest(arrays):
        raise _damaged(path, 'safetensors', 'its numbers are not those that were written')
    return arrays


def _read_npz(path: Path) -> Arrays:
    """Return the arrays of a NumPy archive; objects in it are refused."""
    with path.open('rb') as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        # The libraries raise whatever the damage of a file makes them stumble over.
        except Exception as error:
            raise _damaged(path, 'NumPy archive', error) from error


def _read_torch(path: Path) -> Arrays:
    """Return the tensors of a state dictionary, alone or as `state_dict` of a checkpoint."""
    with path.open('rb') as file:
        try:
            content = torch.load(file, map_location='cpu', weights_only=True)
        except pickle.UnpicklingError as error:
            raise WeightsError(f'{path} holds more than tensors, or is damaged; expected a state '
                               'dictionary; save network.state_dict() alone') from error
        except Exception as error:
            raise _damaged(path, 'PyTorch', error) from error
    if isinstance(content, Mapping):
        content = content.get('state_dict', content)
    if not isinstance(content, Mapping):
        raise WeightsError(f'{path} holds a {type(content).__name__}; expected a state '
                           'dictionary; save network.state_dict()')
    return {name: tensor.float().numpy() for name, tensor in content.items()
            if isinstance(tensor, torch.Tensor)}


READERS: dict[str, Callable[[Path], Arrays]] = {
    '.safetensors': _read_safetensors,
    '.npz': _read_npz,
    '.pt': _read_torch,
    '.pth': _read_torch,
    '.mat': read_matconvnet,
    '.caffemodel': read_caffemodel,
}
