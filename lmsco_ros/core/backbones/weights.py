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
import os
from pathlib import Path

import numpy as np
import platformdirs

from lmsco_ros.core.backbones.backbone import Backbone
from lmsco_ros.core.backbones.formats import read_arrays, READERS
from lmsco_ros.core.backbones.registry import find_source, WeightsSource
from lmsco_ros.core.errors import WeightsError

__all__ = ['DIRECTORY_VARIABLE', 'fitting_arrays', 'find_file', 'load_backbone',
           'weights_directory']

DIRECTORY_VARIABLE = 'LMSCO_WEIGHTS_DIR'


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
    return source.architecture.from_arrays(fitting_arrays(source, read_arrays(path), path))


def find_file(source: WeightsSource, directory: Path | None = None) -> Path:
    """
    Return the file that holds a set of weights: the converted one, or one as published.

    Raises
    ------
    WeightsError
        When there is none; tells how to get it.

    """
    folder = Path(__file__).parent if source.bundled else weights_directory(directory)
    names = [f'{source.name}{suffix}' for suffix in READERS]
    for name in (*names, source.file_name):
        if (folder / name).is_file():
            return folder / name
    if source.bundled:
        raise WeightsError(f'the installed package lacks {source.file_name}; install it again')
    ways = [f'`lmsco weights import FILE --as {source.name}` where you have the file']
    if source.url:
        ways.insert(0, f'`lmsco weights fetch {source.name}` to download it')
    raise WeightsError(
        f'the weights {source.name} are not in {folder}; run {", or ".join(ways)}; '
        'the presets default and hcs need none')


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
    named = source.architecture.own_names(arrays)
    remedy = (f'this is not the network of {source.file_name}; '
              f'get that file and run `lmsco weights import FILE --as {source.name}`')
    fitting = {}
    for name, shape in source.architecture.file_shapes().items():
        if name not in named:
            raise WeightsError(f'{path} has no array {name} of shape {shape}, which '
                               f'{source.name} needs: {remedy}')
        array = named[name]
        if array.shape != shape:
            raise WeightsError(f'{path}: array {name} has shape {array.shape}, but '
                               f'{source.name} needs {shape}: {remedy}')
        if not np.issubdtype(array.dtype, np.floating) or not np.isfinite(array).all():
            raise WeightsError(f'{path}: array {name} of type {array.dtype} holds other than '
                               'finite real numbers; the file is damaged, get it again')
        fitting[name] = np.ascontiguousarray(array, np.float32)
    return fitting
