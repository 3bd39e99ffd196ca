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

"""A frame: what is accepted as one, and the pixels that the tracker works in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.core.errors import ImageError

__all__ = ['Frame', 'read_frame']

_SMALLEST_SIDE = 8

_EXPECTED = '(H, W) of integers or floating-point numbers, or (H, W, 3) of uint8'


@dataclass(frozen=True, eq=False)
class Frame:
    """
    One image of the camera.

    Attributes
    ----------
    pixels : ndarray, shape (H, W) uint8, uint16 or float32, or (H, W, 3) uint8
        In the byte order of the machine, aligned; the caller's own memory where it is so.
    kind : str
        Size and type as they were given: the same for all frames of a target.

    """

    pixels: np.ndarray
    kind: str


def read_frame(image: np.ndarray) -> Frame:
    """
    Return an image as the tracker works in it.

    Parameters
    ----------
    image : ndarray, shape (H, W), (H, W, 1), or (H, W, 3) of uint8 (BGR)
        Gray images hold any integers or floating-point numbers, in any memory layout and byte
        order. All but uint8 and uint16 become float32: integers beyond 2**24 are rounded to
        its 24 bits, and numbers beyond 1e12 count as pixels without a value, as NaN does. So do
        the masked pixels of a masked array.

    Raises
    ------
    ImageError
        When it is no array, or one of another shape, type or size; says what to do.

    """
    if not isinstance(image, np.ndarray):
        raise ImageError(f'the image is a {type(image).__name__}; expected a NumPy array: '
                         f'{_way_to_array(image)}')
    values = np.asarray(image)
    if values.ndim == 3 and values.shape[2] == 1:
        values, image = values[:, :, 0], image[:, :, 0]
    _check(values)
    name = values.dtype.name
    kind = f'{values.shape} {name}'
    if isinstance(image, np.ma.MaskedArray) and np.ma.is_masked(image):
        return Frame(_without_masked(values, np.ma.getmaskarray(image)), kind)
    return Frame(_converted(values, name if name in ('uint8', 'uint16') else 'float32'), kind)


def _way_to_array(image: object) -> str:
    """Return how to make an array of something else."""
    if image is None:
        return 'see whether the frame could be read at all'
    is_tensor = type(image).__module__.partition('.')[0] == 'torch'
    return f'give {"image.cpu().numpy()" if is_tensor else "np.asarray(image)"}'


def _check(values: np.ndarray) -> None:
    """Raise ImageError unless the tracker can work in the values."""
    if values.ndim == 2 and values.dtype.kind not in 'iuf' or values.ndim not in (2, 3):
        remedy = 'give the counts or temperatures of one image, one number for each pixel'
    elif values.ndim == 3 and values.shape[2] == 4:
        remedy = 'leave the alpha channel out, image[:, :, :3], or give one channel'
    elif values.ndim == 3 and (values.shape[2] != 3 or values.dtype != np.uint8):
        remedy = 'give one channel, for instance image[:, :, 0]'
    elif min(values.shape[:2]) < _SMALLEST_SIDE:
        raise ImageError(f'the image has {values.shape[1]} x {values.shape[0]} pixels; '
                         f'expected at least {_SMALLEST_SIDE} in each direction')
    else:
        return
    raise ImageError(f'the image has shape {values.shape} and type {values.dtype}; '
                     f'expected {_EXPECTED}: {remedy}')


def _converted(values: np.ndarray, dtype: str) -> np.ndarray:
    """Return values in another type; themselves where nothing has to be done."""
    # What float32 cannot hold becomes infinite, which is a pixel without a value.
    with np.errstate(over='ignore'):
        values = values.astype(dtype, copy=False)
    # OpenCV refuses rows that do not begin at a multiple of the size of their numbers.
    return values if values.flags.aligned else values.copy()


def _without_masked(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return gray values with NaN in place of the masked ones."""
    if values.ndim == 3:
        raise ImageError('the image is a masked array of colors, of which a part cannot be left '
                         'out; give image.filled(), or one channel')
    return np.where(mask, np.float32(np.nan), _converted(values, 'float32'))
