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

"""From a name to a network with its weights, and from published files to the common one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import os
from pathlib import Path

import numpy as np
import platformdirs

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.networks.backbone import Backbone
from lmsco_ros.core.weights.download import download, file_sha256, Progress
from lmsco_ros.core.weights.formats import (
    declared_arrays, read_about, read_arrays, READERS, write_arrays)
from lmsco_ros.core.weights.registry import find_source, WeightsSource

__all__ = ['DIRECTORY_VARIABLE', 'Verification', 'fetch_weights', 'find_file', 'fitting_arrays',
           'import_weights', 'load_backbone', 'locate', 'verify_weights', 'weights_directory']

DIRECTORY_VARIABLE = 'LMSCO_WEIGHTS_DIR'


@dataclass(frozen=True)
class Verification:
    """
    What is known of a set of weights that was found to be whole.

    Attributes
    ----------
    path : Path
        The file.
    numbers : int
        Number of weights.
    source_sha256 : str or None
        Checksum of the file that was imported, or of this one where it is as published; None
        where that is not told.

    """

    path: Path
    numbers: int
    source_sha256: str | None


def weights_directory(override: Path | None = None) -> Path:
    """
    Return the folder of the weights, which need not exist.

    Parameters
    ----------
    override : Path, optional
        The folder; without it the environment variable `DIRECTORY_VARIABLE` names it, and
        without that it is the user's cache.

    """
    chosen = override or os.environ.get(DIRECTORY_VARIABLE)
    return Path(chosen) if chosen else platformdirs.user_cache_path('lmsco_ros') / 'weights'


def load_backbone(name: str, directory: Path | None = None) -> Backbone:
    """
    Return a new network with the weights called `name`, ready to run in float32.

    Parameters
    ----------
    name : str
        Of the registry.
    directory : Path, optional
        See `weights_directory`.

    Raises
    ------
    WeightsError
        When the name is unknown, the file is missing or damaged, or holds another network.

    """
    source = find_source(name)
    path = find_file(source, directory)
    return source.architecture.from_arrays(_read_fitting(source, path))


def locate(source: WeightsSource, directory: Path | None = None) -> Path | None:
    """
    Return the file that holds a set of weights, converted or as published, or None.

    Bundled weights lie in the package; those in a `directory` that is given, trained by the
    user, go before them.
    """
    if source.bundled:
        folders = [Path(__file__).parent] if directory is None else [
            directory, Path(__file__).parent]
    else:
        folders = [weights_directory(directory)]
    names = (*(f'{source.name}{suffix}' for suffix in READERS), source.file_name)
    return next((folder / name for folder in folders for name in names
                 if (folder / name).is_file()), None)


def find_file(source: WeightsSource, directory: Path | None = None) -> Path:
    """
    Return the file that holds a set of weights, converted or as published.

    Raises
    ------
    WeightsError
        When there is none; tells how to get it.

    """
    path = locate(source, directory)
    if path is not None:
        return path
    if source.bundled:
        raise WeightsError(f'the installed package lacks {source.file_name}; install it again')
    way = f'`lmsco weights import FILE --as {source.name}` where you have the file'
    if source.url:
        way = f'`lmsco weights fetch {source.name}` to download them, or {way}'
    elif source.page:
        way = f'{way} (see {source.page})'
    raise WeightsError(f'the weights {source.name} are not in {weights_directory(directory)}; '
                       f'run {way}; the presets default and hcs need none')


def import_weights(file: Path, name: str, directory: Path | None = None) -> Path:
    """
    Convert a file of any known format to the one that loads fast, and return where it is.

    Parameters
    ----------
    file : Path
        A published file, see `READERS` for the formats.
    name : str
        The weights that it holds, of the registry.
    directory : Path, optional
        See `weights_directory`.

    Raises
    ------
    WeightsError
        When the name is unknown or of bundled weights, or the file is damaged, holds another
        network, or bears the name of the published file but not its checksum.

    """
    source = _foreign_source(name)
    found = file_sha256(file)
    if file.name == source.file_name and source.sha256 not in (None, found):
        raise WeightsError(f'{file} has the SHA-256 checksum {found}, expected {source.sha256}; '
                           'it is damaged or was changed: get it again')
    arrays = _read_fitting(source, file)
    path = weights_directory(directory) / f'{source.name}.safetensors'
    write_arrays(path, arrays, {'weights': source.name, 'source_file': file.name,
                                'source_sha256': found})
    return path


def fetch_weights(name: str, directory: Path | None = None,
                  progress: Progress = lambda done, total: None) -> Path:
    """
    Download the published file of a set of weights, convert it, and return where it is.

    Parameters
    ----------
    name, directory
        As for `import_weights`.
    progress : callable
        As for `download`.

    Raises
    ------
    WeightsError
        When the weights have no address, or as for `download` and `import_weights`.

    """
    source = _foreign_source(name)
    if source.url is None:
        where = f'look at {source.page}, then' if source.page else 'get the file, then'
        raise WeightsError(f'the weights {name} have no address to download from; {where} run '
                           f'`lmsco weights import FILE --as {name}`')
    file = weights_directory(directory) / source.file_name
    try:
        download(source.url, file, source.sha256, progress)
    except WeightsError as error:
        raise WeightsError(f'{error}; or get the file by other means and run '
                           f'`lmsco weights import FILE --as {name}`') from error
    try:
        return import_weights(file, name, directory)
    finally:
        file.unlink()


def _foreign_source(name: str) -> WeightsSource:
    """Return the source of weights that a user has to get."""
    source = find_source(name)
    if source.bundled:
        raise WeightsError(f'the weights {name} come with the package; there is nothing to get')
    return source


def verify_weights(name: str, directory: Path | None = None) -> Verification:
    """
    Return what is known of a set of weights, read and checked in full.

    Raises
    ------
    WeightsError
        When they are missing or damaged, hold another network, or were made from a file with
        another checksum than the published one.

    """
    source = find_source(name)
    path = find_file(source, directory)
    arrays = _read_fitting(source, path)
    found = (file_sha256(path) if path.name == source.file_name
             else read_about(path).get('source_sha256'))
    if None not in (found, source.sha256) and found != source.sha256:
        raise WeightsError(f'{path} comes from a file with the SHA-256 checksum {found}, '
                           f'expected {source.sha256}; get the published file and import it')
    return Verification(path, sum(array.size for array in arrays.values()), found)


def fitting_arrays(source: WeightsSource, arrays: Mapping[str, np.ndarray],
                   path: Path) -> dict[str, np.ndarray]:
    """
    Return what the network needs of the arrays of a file, in float32.

    Parameters
    ----------
    source : WeightsSource
        The weights that the file should hold.
    arrays : mapping of str to ndarray
        All that it holds; layers beyond those of the network are left out.
    path : Path
        The file, for messages.

    Raises
    ------
    WeightsError
        When an array is missing, has another shape, or holds other than finite numbers.

    """
    fitting = {}
    for name, array in _matching(source, arrays, path).items():
        if not np.issubdtype(array.dtype, np.floating) or not np.isfinite(array).all():
            raise WeightsError(f'{path}: array {name} of type {array.dtype} holds other than '
                               'finite real numbers; the file is damaged, get it again')
        fitting[name] = np.ascontiguousarray(array, np.float32)
    return fitting


def _read_fitting(source: WeightsSource, path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a network; what the file declares is checked before it is read."""
    declared = declared_arrays(path)
    if declared is not None:
        _matching(source, declared, path)
    return fitting_arrays(source, read_arrays(path), path)


def _matching(source: WeightsSource, arrays: Mapping[str, np.ndarray],
              path: Path) -> dict[str, np.ndarray]:
    """Return the arrays that the network needs, of the right names and shapes."""
    named = source.architecture.own_names(arrays)
    remedy = (f'this is not the network of {source.file_name}; '
              f'get that file and run `lmsco weights import FILE --as {source.name}`')
    matching = {}
    for name, shape in source.architecture.file_shapes().items():
        if name not in named:
            raise WeightsError(f'{path} has no array {name} of shape {shape}, which '
                               f'{source.name} needs: {remedy}')
        if named[name].shape != shape:
            raise WeightsError(f'{path}: array {name} has shape {named[name].shape}, but '
                               f'{source.name} needs {shape}: {remedy}')
        matching[name] = named[name]
    return matching
