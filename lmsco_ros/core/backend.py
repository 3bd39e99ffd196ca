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

"""Where the numerics run: NumPy arrays on the CPU, torch tensors on a GPU."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
import sys
from typing import Any

import array_api_compat
from array_api_compat import is_torch_array
import array_api_compat.numpy as numpy_namespace
import cv2
import numpy as np
import scipy.fft
from threadpoolctl import threadpool_limits

from lmsco_ros.core.errors import ConfigError

Array = Any
"""An array of any library that follows the Python array API standard."""

__all__ = ['Array', 'Backend', 'array_namespace', 'irfft2', 'limit_threads', 'real_matmul',
           'rfft2', 'select_backend', 'to_numpy']


@dataclass(frozen=True)
class Backend:
    """
    Array library, device and precision of the running path.

    Attributes
    ----------
    namespace : module
        Array API namespace.
    device : object
        Device of new arrays, in the terms of `namespace`.
    dtype : str
        'float32' or 'float64'; spectra have the complex type of the same precision.

    """

    namespace: Any
    device: Any
    dtype: str = 'float32'

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the library by its name: modules cannot be."""
        return _backend_of, (self.namespace.__name__, str(self.device), self.dtype)

    @property
    def real(self) -> Any:
        """Real data type."""
        return getattr(self.namespace, self.dtype)

    @property
    def complex(self) -> Any:
        """Complex data type of the same precision."""
        return getattr(self.namespace, {'float32': 'complex64', 'float64': 'complex128'}[
            self.dtype])

    def asarray(self, values: Any) -> Array:
        """Move real `values` to the device, in the real data type."""
        return self.namespace.asarray(values, dtype=self.real, device=self.device)


def select_backend(device_name: str, dtype: str = 'float32') -> Backend:
    """
    Return the back end for a device name.

    Parameters
    ----------
    device_name : str
        'cpu' for NumPy; 'cuda' or 'cuda:N' for torch on that GPU.
    dtype : {'float32', 'float64'}
        Precision.

    Raises
    ------
    ConfigError
        When the device is unknown or not present.

    """
    if device_name == 'cpu':
        return Backend(numpy_namespace, 'cpu', dtype)
    import array_api_compat.torch as torch_namespace
    import torch
    if device_name.partition(':')[0] != 'cuda' or not torch.cuda.is_available():
        raise ConfigError(f'device {device_name!r} is not available here; use "cpu", or "cuda" '
                          'on a machine with an NVIDIA GPU and a CUDA build of torch')
    return Backend(torch_namespace, torch.device(device_name), dtype)


def _backend_of(library: str, device_name: str, dtype: str) -> Backend:
    """Return the back end of a copy: as `select_backend`, but torch may be on the CPU as well."""
    if library == numpy_namespace.__name__ or device_name != 'cpu':
        return select_backend(device_name, dtype)
    import torch
    return Backend(import_module(library), torch.device(device_name), dtype)


def array_namespace(values: Array) -> Any:
    """Return the array API namespace of an array; that of NumPy at once, which is asked most."""
    return numpy_namespace if type(values) is np.ndarray else array_api_compat.array_namespace(
        values)


def limit_threads(count: int) -> None:
    """
    Let OpenCV and the linear algebra libraries use `count` threads in this process.

    A tracker that takes every core starves the executor that feeds it frames.
    """
    cv2.setNumThreads(count)
    threadpool_limits(limits=count)
    if 'torch' in sys.modules:
        sys.modules['torch'].set_num_threads(count)


def rfft2(values: Array) -> Array:
    """Transform real `values` of shape (N, M, ...) over the first two axes."""
    if is_torch_array(values):
        return array_namespace(values).fft.rfftn(values, axes=(0, 1))
    return scipy.fft.rfftn(values, axes=(0, 1))


def irfft2(spectrum: Array, size: int) -> Array:
    """Inverse of `rfft2` onto a grid of `size` by `size` points."""
    if is_torch_array(spectrum):
        return array_namespace(spectrum).fft.irfftn(spectrum, s=(size, size), axes=(0, 1))
    return scipy.fft.irfftn(spectrum, s=(size, size), axes=(0, 1))


def real_matmul(matrix: Array, values: Array) -> Array:
    """
    Return `matrix` @ `values` for a real matrix and complex values.

    Parameters
    ----------
    matrix : array, shape (m, n)
        Real.
    values : array, shape (..., n, c)
        Complex, contiguous; half the multiplications of a complex product.

    """
    if is_torch_array(values):
        import torch
        pairs = torch.view_as_real(values).flatten(-2)
        return torch.view_as_complex((matrix @ pairs).unflatten(-1, (-1, 2)))
    return (matrix @ values.view(matrix.dtype)).view(values.dtype)


def to_numpy(values: Array) -> np.ndarray:
    """Copy an array of any back end to NumPy; NumPy arrays pass through."""
    return values.cpu().numpy() if is_torch_array(values) else np.asarray(values)
