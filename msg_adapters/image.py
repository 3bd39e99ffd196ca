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
Images: `sensor_msgs/Image` and `sensor_msgs/CompressedImage` <-> arrays.

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

from msg_adapters.compressed_size import declared_size, JPEG_START, PNG_START
from msg_adapters.errors import ImageMessageError

if TYPE_CHECKING:
    from sensor_msgs.msg import CompressedImage, Image
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
_PNG_END, _JPEG_END = b'IEND\xaeB`\x82', b'\xff\xd9'
# A small file may unfold to gigabytes; thermal sensors stay far below this.
_MOST_COMPRESSED_PIXELS = 2 ** 26


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

    encoding = _fitting_encoding(image, encoding)
    pixels = cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if encoding == 'rgb8' else image
    height, width = image.shape[:2]
    return Image(
        header=header or Header(), height=height, width=width, encoding=encoding,
        is_bigendian=_NATIVE_IS_BIG_ENDIAN, step=image.itemsize * image[0].size,
        data=_byte_array(pixels))


def image_from_compressed(message: CompressedImage) -> npt.NDArray:
    """
    Return the pixels of a jpeg or png message.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
        The data itself tells jpeg from png; `format` is not relied upon.

    Returns
    -------
    ndarray, shape (H, W) uint8 or uint16 (png only), or (H, W, 3) uint8 (BGR)

    Raises
    ------
    ImageMessageError
        When the data is neither jpeg nor png, is incomplete or damaged, holds another
        kind of pixels, or more of them than a camera sends.

    """
    data = np.frombuffer(message.data, np.uint8)
    _check_complete(data, message.format)
    _check_declared_size(data, message.format)
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ImageMessageError(
            f'compressed image (format "{message.format}") was refused by the decoder: '
            f'{error}; send smaller frames') from error
    if pixels is None:
        raise ImageMessageError(
            f'compressed image (format "{message.format}", {data.size} bytes) is damaged; '
            'expected a whole jpeg or png file: check the transport')
    _fitting_encoding(pixels, '')
    return pixels


def compressed_from_image(image: npt.NDArray, *, codec: str = 'png',
                          header: Header | None = None) -> CompressedImage:
    """
    Return a compressed message with the pixels of an array.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        uint8 or uint16; color as uint8, BGR.
    codec : {'png', 'jpeg'}
        png keeps every value; jpeg does not, and takes 8 bit only.
    header : std_msgs/Header, optional
        Stamp and frame; empty by default.

    Raises
    ------
    ImageMessageError
        When the codec is unknown or cannot hold the array.

    """
    from sensor_msgs.msg import CompressedImage
    from std_msgs.msg import Header

    if codec not in ('png', 'jpeg'):
        raise ImageMessageError(f'codec "{codec}" is unknown; expected "png" or "jpeg"')
    encoding = _fitting_encoding(image, '')
    depths = {'png': (np.uint8, np.uint16), 'jpeg': (np.uint8,)}[codec]
    if image.dtype not in depths:
        raise ImageMessageError(
            f'{codec} cannot hold {image.dtype} pixels; use '
            + ('png for 16 bit' if image.dtype == np.uint16 else 'sensor_msgs/Image for floats'))
    _, data = cv2.imencode('.png' if codec == 'png' else '.jpg', image)
    return CompressedImage(header=header or Header(), data=_byte_array(data),
                           format=f'{encoding}; {codec} compressed {encoding}')


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


def _fitting_encoding(image: npt.NDArray, encoding: str) -> str:
    """Return `encoding`, or by default the first, that holds arrays like `image`."""
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


def _check_complete(data: npt.NDArray[np.uint8], declared: str) -> None:
    """Refuse data that is no jpeg or png file, or one without its end."""
    start, end = data[:4].tobytes(), data[-64:].tobytes().rstrip(b'\0')
    if start == PNG_START:
        complete = end.endswith(_PNG_END)
    elif start.startswith(JPEG_START):
        complete = end.endswith(_JPEG_END)
    else:
        raise ImageMessageError(
            f'compressed image (format "{declared}", {data.size} bytes) is neither jpeg nor '
            'png; publish one of these, or use the raw image topic')
    if not complete:
        # Some decoders fill what is missing with gray, which would be tracked in.
        raise ImageMessageError(
            f'compressed image (format "{declared}", {data.size} bytes) is truncated; expected '
            'a whole jpeg or png file: check the driver and the transport')


def _check_declared_size(data: npt.NDArray[np.uint8], declared: str) -> None:
    """Refuse a file that would take more memory than any camera's image."""
    width, height = declared_size(memoryview(data)) or (0, 0)
    if width * height > _MOST_COMPRESSED_PIXELS:
        raise ImageMessageError(
            f'compressed image (format "{declared}", {data.size} bytes) claims {width} x {height} '
            f'pixels; expected at most {_MOST_COMPRESSED_PIXELS}: send smaller frames')


def _byte_array(values: npt.NDArray) -> array:
    """Return the bytes of an array as the one type that a message takes unchecked."""
    data = array('B')
    data.frombytes(memoryview(np.ascontiguousarray(values)).cast('B'))
    return data
