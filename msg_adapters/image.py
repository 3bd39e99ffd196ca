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

"""Raw images: `sensor_msgs/Image` <-> arrays, by the table of `msg_adapters.encodings`."""

from __future__ import annotations

from array import array
import sys
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from msg_adapters.encodings import fitting_encoding, Layout, layout_of
from msg_adapters.errors import ImageMessageError

if TYPE_CHECKING:
    from sensor_msgs.msg import Image
    from std_msgs.msg import Header

_NATIVE_IS_BIG_ENDIAN = sys.byteorder == 'big'


def image_from_message(message: Image) -> npt.NDArray:
    """
    Return the pixels of an image message.

    The array is a view of the message's data wherever its layout allows (native byte
    order, rows that start on whole values, nothing to convert); treat it as read-only.

    Parameters
    ----------
    message : sensor_msgs/Image
        Any encoding of the table, rows padded or not, either byte order.

    Returns
    -------
    ndarray, shape (H, W) or (H, W, 3)
        Gray of type uint8, uint16, int16, int32, float32 or float64 with the values of the
        message, in native byte order; or BGR of type uint8.

    Raises
    ------
    ImageMessageError
        When the encoding is unknown, the image is empty, a row does not fit into its
        step, or data is missing.

    """
    layout = layout_of(message.encoding)
    _check_size(message, layout)
    dtype, channels = layout.dtype, layout.channels
    foreign = bool(message.is_bigendian) != _NATIVE_IS_BIG_ENDIAN
    shape = (message.height, message.width) + ((channels,) if channels > 1 else ())
    strides = (message.step, layout.pixel_bytes) + (dtype.itemsize,) * (channels > 1)
    pixels = np.ndarray(shape, dtype.newbyteorder() if foreign else dtype,
                        buffer=message.data, strides=strides)
    if foreign and dtype.itemsize > 1 or not pixels.flags.aligned:
        pixels = pixels.astype(dtype, order='C')
    return layout.to_array(pixels)


def message_from_image(image: npt.NDArray, *, encoding: str = '',
                       header: Header | None = None) -> Image:
    """
    Return an image message with the pixels of an array.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        uint8, uint16, int16, int32, float32 or float64; color as uint8, BGR.
    encoding : str
        One that keeps the array; by default mono8, mono16, 32FC1, bgr8, 16SC1, 32SC1 or
        64FC1. With ``rgb8`` the channels are reordered.
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
    pixels = layout_of(encoding).to_pixels(image)
    height, width = image.shape[:2]
    return Image(
        header=header or Header(), height=height, width=width, encoding=encoding,
        is_bigendian=_NATIVE_IS_BIG_ENDIAN, step=image.itemsize * image[0].size,
        data=byte_array(pixels))


def _check_size(message: Image, layout: Layout) -> None:
    """Refuse a message whose size, step and amount of data contradict each other."""
    if not message.width or not message.height:
        raise ImageMessageError(
            f'image is empty ({message.width} x {message.height} pixels); expected at least '
            'one pixel: check the camera driver')
    if min(message.width, message.height) < layout.smallest_side:
        raise ImageMessageError(
            f'image has {message.width} x {message.height} pixels; expected at least '
            f'{layout.smallest_side} in each direction of {message.encoding}: check the driver')
    row = message.width * layout.pixel_bytes
    if message.step < row:
        raise ImageMessageError(
            f'image step is {message.step} bytes; a row of {message.width} {message.encoding} '
            f'pixels takes {row}: set step to {row} or more')
    rows = layout.rows(message.height)
    # Padding behind the last row carries nothing, and some drivers leave it out.
    needed = message.step * (rows - 1) + row
    if len(message.data) < needed:
        raise ImageMessageError(
            f'image data is truncated: it has {len(message.data)} bytes, expected {needed} for '
            f'{rows} rows of {message.step} bytes; check the driver and the transport')


def byte_array(values: npt.NDArray) -> array:
    """Return the bytes of an array as the one type that a message takes unchecked."""
    data = array('B')
    data.frombytes(np.ascontiguousarray(values).data.cast('B'))
    return data
