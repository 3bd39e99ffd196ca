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

"""Compressed images: `sensor_msgs/CompressedImage` <-> arrays, at a bounded cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from msg_adapters.compressed_size import declared_size, JPEG_START, PNG_START
from msg_adapters.errors import ImageMessageError
from msg_adapters.image import byte_array, fitting_encoding

if TYPE_CHECKING:
    from sensor_msgs.msg import CompressedImage
    from std_msgs.msg import Header

_PNG_END, _JPEG_END = b'IEND\xaeB`\x82', b'\xff\xd9'


@dataclass(frozen=True)
class DecodingLimits:
    """
    What a compressed image may cost: a small file may unfold to gigabytes or take minutes.

    Attributes
    ----------
    pixels : int
        Most pixels of an image.
    scans : int
        Most scans of a jpeg file.

    """

    pixels: int = 2 ** 26
    scans: int = 100


def image_from_compressed(message: CompressedImage,
                          limits: DecodingLimits = DecodingLimits()) -> npt.NDArray:
    """
    Return the pixels of a jpeg or png message.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
        The data itself tells jpeg from png; `format` is not relied upon.
    limits : DecodingLimits, optional
        What decoding may cost; checked before anything is decoded.

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
    _check_declared_size(data, message.format, limits)
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
    fitting_encoding(pixels, '')
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
    encoding = fitting_encoding(image, '')
    depths = {'png': (np.uint8, np.uint16), 'jpeg': (np.uint8,)}[codec]
    if image.dtype not in depths:
        raise ImageMessageError(
            f'{codec} cannot hold {image.dtype} pixels; use '
            + ('png for 16 bit' if image.dtype == np.uint16 else 'sensor_msgs/Image for floats'))
    _, data = cv2.imencode('.png' if codec == 'png' else '.jpg', image)
    return CompressedImage(header=header or Header(), data=byte_array(data),
                           format=f'{encoding}; {codec} compressed {encoding}')


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


def _check_declared_size(data: npt.NDArray[np.uint8], declared: str,
                         limits: DecodingLimits) -> None:
    """Refuse a file that would take more memory than any camera's image."""
    width, height = declared_size(memoryview(data)) or (0, 0)
    if width * height > limits.pixels:
        raise ImageMessageError(
            f'compressed image (format "{declared}", {data.size} bytes) claims {width} x {height} '
            f'pixels; expected at most {limits.pixels}: send smaller frames')
