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

from collections.abc import Callable
from pathlib import Path
import zipfile
import zlib

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file

from lmsco_ros.core.errors import WeightsError

__all__ = ['READERS', 'read_arrays']

Arrays = dict[str, np.ndarray]


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
        raise WeightsError(f'{path} has a suffix that says nothing of its format; expected one '
                           f'of {", ".join(READERS)}')
    return reader(path)


def _damaged(path: Path, kind: str, reason: object) -> WeightsError:
    """Return the error of a file that is not what its suffix says."""
    return WeightsError(f'{path} is damaged, or no {kind} file ({reason}); get it again')


def _read_safetensors(path: Path) -> Arrays:
    """Return the arrays of a safetensors file."""
    try:
        return load_file(path)
    except SafetensorError as error:
        raise _damaged(path, 'safetensors', error) from error


def _read_npz(path: Path) -> Arrays:
    """Return the arrays of a NumPy archive; objects in it are refused."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, EOFError, AttributeError, zipfile.BadZipFile, zlib.error) as error:
        raise _damaged(path, 'NumPy archive', error) from error


READERS: dict[str, Callable[[Path], Arrays]] = {
    '.safetensors': _read_safetensors,
    '.npz': _read_npz,
}
