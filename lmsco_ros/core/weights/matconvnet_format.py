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

"""Arrays of the MATLAB files that MatConvNet keeps simple networks in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from lmsco_ros.core.errors import WeightsError
from lmsco_ros.core.weights.matlab_file import FileTooLarge, unfold

__all__ = ['read_matconvnet']

# Version 2 of the format, in either byte order: HDF5 inside.
_NEWER = (b'\x00\x02', b'\x02\x00')


def read_matconvnet(path: Path, limit: int) -> dict[str, np.ndarray]:
    """
    Return kernels (out, in, kh, kw), biases (out,) and, where it is told, the mean (3,).

    Both generations are read: layers with a cell `weights` and those with `filters` and
    `biases`; the network itself, or a variable `net` that holds it.

    Parameters
    ----------
    path : Path
        The file.
    limit : int
        Bytes that it unfolds to at most.

    Raises
    ------
    WeightsError
        When the file is damaged, of MATLAB 7.3, holds no layers, or more than the limit.

    """
    content = path.read_bytes()
    if content[124:126] in _NEWER:
        raise WeightsError(f'{path} is a file of MATLAB 7.3 or newer; load it there and save it '
                           'with the option -v7')
    try:
        return _network_arrays(loadmat(unfold(content, limit)), path)
    except WeightsError:
        raise
    except FileTooLarge as error:
        raise WeightsError(f'{path} holds more than the {limit} bytes that are read of a network '
                           f'({error}); get it again') from error
    # The library raises whatever the damage of a file makes it stumble over.
    except Exception as error:
        raise WeightsError(f'{path} is damaged, or no MATLAB file with a network of '
                           f'MatConvNet ({error}); get it again') from error


def _network_arrays(content: dict[str, Any], path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of the network among the variables of a file."""
    network = content['net'][0, 0] if 'net' in content else content
    if 'layers' not in _fields(network):
        raise WeightsError(f'{path} has no variable `layers`; expected a network of MatConvNet '
                           '(simplenn)')
    arrays = {}
    for layer in network['layers'].ravel():
        arrays.update(_layer_arrays(layer[0, 0]))
    mean = _mean(network)
    return arrays if mean is None else {**arrays, 'mean': mean}


def _fields(value: Any) -> tuple[str, ...]:
    """Return the names of the fields of a MATLAB structure, or of the variables of a file."""
    if isinstance(value, dict):
        return tuple(value)
    return value.dtype.names or () if isinstance(value, (np.ndarray, np.void)) else ()


def _layer_arrays(layer: np.void) -> dict[str, np.ndarray]:
    """Return the arrays of one layer; none for a layer without weights."""
    fields = _fields(layer)
    if 'weights' in fields:
        weights = layer['weights'].ravel()
    elif 'filters' in fields:
        weights = [layer['filters'], layer['biases']]
    else:
        return {}
    if len(weights) < 2:
        return {}
    name = str(layer['name'].ravel()[0])
    kernels, bias = weights[0], weights[1]
    # MATLAB drops the last dimensions where they are 1.
    kernels = kernels.reshape(kernels.shape + (1,) * (4 - kernels.ndim))
    return {f'{name}.weight': kernels.transpose(3, 2, 0, 1), f'{name}.bias': bias.reshape(-1)}


def _mean(network: Any) -> np.ndarray | None:
    """Return the mean of each channel that training subtracted, or None where it is not told."""
    fields = _fields(network)
    holder = network['meta'][0, 0] if 'meta' in fields else network
    if 'normalization' not in _fields(holder):
        return None
    normalization = holder['normalization'][0, 0]
    if 'averageImage' not in _fields(normalization):
        return None
    average = normalization['averageImage'].astype(np.float64)
    if average.size == 3:
        return average.reshape(3).astype(np.float32)
    return average.mean(axis=(0, 1)).astype(np.float32)
