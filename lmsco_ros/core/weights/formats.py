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
import zipfile
import zlib

import numpy as np
from safetensors import safe_open, SafetensorError
from safetensors.numpy import load_file, save_file

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.extras import require_extra

__all__ = ['LARGEST', 'READERS', 'declared_arrays', 'read_about', 'read_arrays', 'write_arrays']

Arrays = dict[str, np.ndarray]

LARGEST = 1 << 30
"""Bytes of a file, and of what it unfolds to, that are read; twice the largest known network."""

_DIGEST = 'arrays_sha256'

# The only thing in a checkpoint that takes as much memory as a single number in the file says.
_UNBOUNDED = b'bytearray'


def read_arrays(path: Path, limit: int = LARGEST) -> Arrays:
    """
    Return the arrays of a file under the names that the file gives them.

    Parameters
    ----------
    path : Path
        Its suffix tells the format, see `READERS`.
    limit : int
        Bytes of the file, and of all arrays unfolded, at most.

    Raises
    ------
    WeightsError
        When the format is not known, or the file is damaged or larger than the limit.
    MissingExtraError
        When the format needs the extra `weights`, which is not installed.

    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise WeightsError(f'{path}: the suffix does not tell the format; expected one of '
                           f'{", ".join(READERS)}')
    if path.stat().st_size > limit:
        raise _too_large(path, path.stat().st_size, limit)
    return reader(path, limit)


def declared_arrays(path: Path) -> Arrays | None:
    """
    Return arrays of the names, types and shapes that a file declares, without its numbers.

    None comes back for a format that does not tell before all is read. A NumPy archive does, and
    may unfold to a thousand times its size.

    Raises
    ------
    WeightsError
        When the file is damaged.

    """
    if path.suffix.lower() != '.npz':
        return None
    with path.open('rb') as file:
        try:
            with zipfile.ZipFile(file) as archive:
                return {name.removesuffix('.npy'): _declared_array(archive, name)
                        for name in archive.namelist() if name.endswith('.npy')}
        except Exception as error:
            raise _damaged(path, 'NumPy archive', error) from error


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


def _too_large(path: Path, size: int, limit: int) -> WeightsError:
    """Return the error of a file that holds more than is read."""
    return WeightsError(f'{path} holds {size} bytes, more than the {limit} that are read of a '
                        'network; it holds something else, or is damaged: get it again')


def _declared_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """Return an array as a file in an archive declares it, of one number in all places."""
    with archive.open(name) as file:
        version = np.lib.format.read_magic(file)
        read = {(1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, _, dtype = read(file)
    return np.broadcast_to(np.zeros((), dtype), shape)


def _read_safetensors(path: Path, limit: int) -> Arrays:
    """Return the arrays of a safetensors file; those of `write_arrays` are seen to be whole."""
    try:
        arrays = load_file(path)
    # A type that NumPy lacks is a TypeError.
    except (SafetensorError, TypeError) as error:
        raise _damaged(path, 'safetensors', error) from error
    written = read_about(path).get(_DIGEST)
    if written is not None and written != _digest(arrays):
        raise _damaged(path, 'safetensors', 'its numbers are not those that were written')
    return arrays


def _read_npz(path: Path, limit: int) -> Arrays:
    """Return the arrays of a NumPy archive; objects in it are refused."""
    with path.open('rb') as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                # No member gives more than it declares: the rest is left in the file.
                declared = sum(member.file_size for member in archive.zip.infolist())
                if declared > limit:
                    raise _too_large(path, declared, limit)
                return {name: array for name in archive.files
                        if isinstance(array := archive[name], np.ndarray)}
        except WeightsError:
            raise
        # The libraries raise whatever the damage of a file makes them stumble over.
        except Exception as error:
            raise _damaged(path, 'NumPy archive', error) from error


def _read_torch(path: Path, limit: int) -> Arrays:
    """Return the tensors of a state dictionary, alone or as `state_dict` of a checkpoint."""
    import torch

    _check_checkpoint(path, limit)
    with path.open('rb') as file:
        try:
            content = torch.load(file, map_location='cpu', weights_only=True)
        except pickle.UnpicklingError as error:
            raise _more_than_tensors(path) from error
        except Exception as error:
            raise _damaged(path, 'PyTorch', error) from error
    if isinstance(content, Mapping):
        content = content.get('state_dict', content)
    if not isinstance(content, Mapping):
        raise WeightsError(f'{path} holds a {type(content).__name__}; expected a state '
                           'dictionary; save network.state_dict()')
    tensors = {name: value for name, value in content.items() if isinstance(value, torch.Tensor)}
    # One number in the file may stand for all of a tensor.
    size = sum(4 * tensor.numel() for tensor in tensors.values())
    if size > limit:
        raise _too_large(path, size, limit)
    try:
        return {name: tensor.float().numpy() for name, tensor in tensors.items()}
    # Tensors that are sparse, for instance.
    except (TypeError, RuntimeError) as error:
        raise _more_than_tensors(path) from error


def _check_checkpoint(path: Path, limit: int) -> None:
    """Refuse what would take more memory than the limit before PyTorch reads it."""
    if zipfile.is_zipfile(path):
        try:
            with zipfile.ZipFile(path) as archive:
                declared = sum(member.file_size for member in archive.infolist())
                if declared > limit:
                    raise _too_large(path, declared, limit)
                programs = [archive.read(name) for name in archive.namelist()
                            if name.endswith('.pkl')]
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
            raise _damaged(path, 'PyTorch', error) from error
    else:
        programs = [path.read_bytes()]
    if any(_UNBOUNDED in program for program in programs):
        raise _more_than_tensors(path)


def _more_than_tensors(path: Path) -> WeightsError:
    """Return the error of a checkpoint of which not all can be read without danger."""
    return WeightsError(f'{path} holds more than tensors (dense ones), or is damaged; expected '
                        'a state dictionary; save network.state_dict() alone')


def _read_matconvnet(path: Path, limit: int) -> Arrays:
    """Return the arrays of a network of MatConvNet."""
    from lmsco_ros.core.weights.matconvnet_format import read_matconvnet

    return read_matconvnet(path, limit)


def _read_caffemodel(path: Path, limit: int) -> Arrays:
    """Return the arrays of a network of Caffe: as long in the file as in memory."""
    require_extra('weights', f'{path.name}, a file of Caffe,')
    from lmsco_ros.core.weights.caffe_format import read_caffemodel

    return read_caffemodel(path)


READERS: dict[str, Callable[[Path, int], Arrays]] = {
    '.safetensors': _read_safetensors,
    '.npz': _read_npz,
    '.pt': _read_torch,
    '.pth': _read_torch,
    '.mat': _read_matconvnet,
    '.caffemodel': _read_caffemodel,
}
