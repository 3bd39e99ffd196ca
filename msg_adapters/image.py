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

"""
Raw images: `sensor_msgs/Image` <-> arrays.

==================  =====================
encoding            array
==================  =====================
``mono8``, 8UC1     (H, W) uint8
``mono16``, 16UC1   (H, W) uint16
32FC1               (H, W) float32
``bgr8``, rgb8      (H, W, 3) uint8, BGR
==================  =====================
"""

from __future__ import annotations

from array import array
import sys
from types import MappingProxyType
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from msg_adapters.errors import ImageMessageError

if TYPE_CHECKING:
    from sensor_msgs.msg import Image
    from std_msgs.msg import Header

# Encoding -> (type of one value, values in a pixel).
ENCODINGS = MappingProxyType({
    'mono8': (np.dtype(np.uint8), 1),
    '8UC1': (np.dtype(np.uint8), 1),
    'mono16': (np.dtype(np.uint16), 1),
    '16UC1': (np.dtype(np.uint16), 1),
    '32FC1': (np.dtype(np.float32), 1),
    'bgr8': (np.dtype(np.uint8), 3),
    'rgb8': (np.dtype(np.uint8), 3),
})
_NATIVE_IS_BIG_ENDIAN = sys.byteorder == 'big'


def image_from_message(message: Image) -> npt.NDArray:
    """
    Return the pixels of an image message.

    The array is a view of the message's data wherever its layout allows (native byte
    order, rows that start on whole values, not rgb8); treat it as read-only.

    Parameters
    ----------
    message : sensor_msgs/Image
        Any encoding of the table above, rows padded or not, either byte order.

    Returns
    -------
    ndarray, shape (H, W) or (H, W, 3)
        In native byte order; color as BGR.

    Raises
    ------
    ImageMessageError
        When the encoding is unknown, the image is empty, a row does not fit into its
        step, or data is missing.

    """
    dtype, channels = _layout(message.encoding)
    _check_size(message, dtype.itemsize * channels)
    foreign = bool(message.is_bigendian) != _NATIVE_IS_BIG_ENDIAN
    shape = (message.height, message.width) + ((channels,) if channels > 1 else ())
    strides = (message.step, dtype.itemsize * channels) + (dtype.itemsize,) * (channels > 1)
    pixels = np.ndarray(shape, dtype.newbyteorder() if foreign else dtype,
                        buffer=message.data, strides=strides)
    if message.encoding == 'rgb8':
        return cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR)
    if foreign and dtype.itemsize > 1 or message.step % dtype.itemsize:
        return pixels.astype(dtype, order='C')
    return pixels


def message_from_image(image: npt.NDArray, *, encoding: str = '',
                       header: Header | None = None) -> Image:
    """
    Return an image message with the pixels of an array.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        uint8, uint16 or float32; color as uint8, BGR.
    encoding : str
        One that fits the array; by default mono8, mono16, 32FC1 or bgr8. With ``rgb8``
        the channels are reordered.
    header : std_msgs/Header, optional
        Stamp and frame; empty by default.

    Raises
    ------
    ImageMessageError
        When no encoding, or not the given one, fits the array.

    """
    # Images of a bag are decoded where there are no messages to make.
    from sensor_msgs.msg import Image
    from std_msgs.msg import Header

    encoding = fitting_encoding(image, encoding)
    pixels = cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if encoding == 'rgb8' else image
    height, width = image.shape[:2]
    return Image(
        header=header or Header(), height=height, width=width, encoding=encoding,
        is_bigendian=_NATIVE_IS_BIG_ENDIAN, step=image.itemsize * image[0].size,
        data=byte_array(pixels))


def _layout(encoding: str) -> tuple[np.dtype, int]:
    """Return the type of one value and the number of values in a pixel."""
    try:
        return ENCODINGS[encoding]
    except KeyError:
        raise ImageMessageError(
            f'image encoding "{encoding}" is not supported; expected one of '
            f'{", ".join(ENCODINGS)}: set it in the camera driver, or convert') from None


def _check_size(message: Image, pixel_bytes: int) -> None:
    """Refuse a message whose size, step and amount of data contradict each other."""
    if not message.width or not message.height:
        raise ImageMessageError(
            f'image is empty ({message.width} x {message.height} pixels); expected at least '
            'one pixel: check the camera driver')
    row = message.width * pixel_bytes
    if message.step < row:
        raise ImageMessageError(
            f'image step is {message.step} bytes; a row of {message.width} {message.encoding} '
            f'pixels takes {row}: set step to {row} or more')
    # Padding behind the last row carries nothing, and some drivers leave it out.
    needed = message.step * (message.height - 1) + row
    if len(message.data) < needed:
        raise ImageMessageError(
            f'image data is truncated: it has {len(message.data)} bytes, expected {needed} for '
            f'{message.height} rows of {message.step} bytes; check the driver and the transport')


def fitting_encoding(image: npt.NDArray, encoding: str) -> str:
    """
    Return the encoding of a message that holds an array.

    Parameters
    ----------
    image : ndarray
        What has to be held.
    encoding : str
        The wanted one; empty for the first that fits.

    Raises
    ------
    ImageMessageError
        When none, or not the wanted one, fits.

    """
    channels = 1 if image.ndim == 2 else image.shape[2] if image.ndim == 3 else 0
    fitting = [name for name, layout in ENCODINGS.items()
               if image.size and layout == (image.dtype, channels)]
    if not fitting:
        raise ImageMessageError(
            f'no encoding for {image.dtype} pixels in an array of shape {image.shape}; expected '
            '(H, W) uint8, uint16 or float32, or (H, W, 3) uint8: convert the image first')
    if encoding and encoding not in fitting:
        raise ImageMessageError(
            f'encoding "{encoding}" does not fit {image.dtype} pixels in an array of shape '
            f'{image.shape}; expected {" or ".join(fitting)}')
    return encoding or fitting[0]


def byte_array(values: npt.NDArray) -> array:
    """Return the bytes of an array as the one type that a message takes unchecked."""
    data = array('B')
    data.frombytes(memoryview(np.ascontiguousarray(values)).cast('B'))
    return data
