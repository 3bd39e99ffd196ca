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

from msg_adapters.compressed_depth import HEAD_BYTES, is_compressed_depth, read_depth_coding
from msg_adapters.encodings import fitting_encoding, without_alpha
from msg_adapters.errors import ImageMessageError
from msg_adapters.image import byte_array
from msg_adapters.image_file import ImageFile
from msg_adapters.jpeg_file import JPEG_START, read_jpeg
from msg_adapters.png_file import check_unfolding, PNG_START, read_png

if TYPE_CHECKING:
    from sensor_msgs.msg import CompressedImage
    from std_msgs.msg import Header

__all__ = ['compressed_from_image', 'DecodingLimits', 'image_from_compressed']

# 16-bit color with transparency takes twice as much, and gets half as many pixels.
_PIXEL_BYTES, _FILE_BYTES = 4, 2
_LONGEST_NAME = 60


@dataclass(frozen=True)
class DecodingLimits:
    """
    What a compressed image may cost: a small file may unfold to gigabytes or take minutes.

    The costliest image within the defaults takes about a second (`benchmarks.decoding_cost`).

    Attributes
    ----------
    pixels : int
        Most pixels of an image. At four bytes a pixel they are also the most memory that the
        pixels may take, and at two bytes the longest file.
    scans : int
        Most scans of a jpeg file: the decoder goes over the whole image once for each.

    """

    pixels: int = 2 ** 24
    scans: int = 50


def image_from_compressed(message: CompressedImage,
                          limits: DecodingLimits = DecodingLimits()) -> npt.NDArray:
    """
    Return the pixels of a jpeg or png message, also of the transport `compressedDepth`.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
        The data itself tells jpeg from png; `format` only tells what the pixels of
        `compressedDepth` are.
    limits : DecodingLimits, optional
        What decoding may cost; checked before anything is decoded.

    Returns
    -------
    ndarray, shape (H, W) uint8 or uint16, or (H, W, 3) uint8 (BGR)
        Without transparency; color of 16 bits becomes gray. Of `compressedDepth` also
        float32.

    Raises
    ------
    ImageMessageError
        When the data is neither jpeg nor png, is incomplete or damaged, its size cannot be
        read, or decoding it would cost more than the limits allow.

    """
    data = memoryview(message.data)
    try:
        if is_compressed_depth(data, message.format):
            coding = read_depth_coding(data, message.format)
            return coding.decode(_decode(data[HEAD_BYTES:], limits))
        return _decode(data, limits)
    except ImageMessageError as error:
        raise ImageMessageError(
            f'compressed image (format "{message.format[:_LONGEST_NAME]}", {len(data)} bytes) '
            f'{error}') from error


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
            + ('png for 16 bit' if image.dtype == np.uint16 else 'sensor_msgs/Image'))
    done, data = cv2.imencode('.png' if codec == 'png' else '.jpg', image)
    if not done:
        raise ImageMessageError(f'{codec} cannot hold {image.shape[1]} x {image.shape[0]} pixels; '
                                'use sensor_msgs/Image')
    return CompressedImage(header=header or Header(), data=byte_array(data),
                           format=f'{encoding}; {codec} compressed {encoding}')


def _decode(data: memoryview, limits: DecodingLimits) -> npt.NDArray:
    """Return the pixels of a jpeg or png file whose cost is within the limits."""
    is_png = data[:len(PNG_START)] == PNG_START
    if is_png:
        file = read_png(data)
    elif data[:len(JPEG_START)] == JPEG_START:
        file = read_jpeg(data)
    else:
        raise ImageMessageError(
            'is neither jpeg nor png; publish one of these, or use the raw image topic')
    _check_cost(file, len(data), limits)
    if is_png:
        check_unfolding(file)
    try:
        pixels = cv2.imdecode(np.frombuffer(file.data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ImageMessageError(
            f'was refused by the decoder: {error}; send smaller frames') from error
    if pixels is None:
        raise ImageMessageError(
            'is damaged; expected a whole jpeg or png file: check the transport')
    if pixels.shape[:2] != (file.height, file.width):
        raise ImageMessageError(
            f'claims {file.width} x {file.height} pixels and holds others; expected a whole jpeg '
            'or png file: check the transport')
    if file.gray and pixels.ndim == 3:
        return cv2.extractChannel(pixels, 0)
    return without_alpha(pixels)


def _check_cost(file: ImageFile, size: int, limits: DecodingLimits) -> None:
    """Refuse a file that would take more than any camera's image."""
    pixels, memory = file.width * file.height, _PIXEL_BYTES * limits.pixels
    if pixels > limits.pixels or pixels * file.pixel_bytes > memory:
        raise ImageMessageError(
            f'claims {file.width} x {file.height} pixels of {file.pixel_bytes} bytes; expected at '
            f'most {limits.pixels} pixels and {memory} bytes: send smaller frames, or raise the '
            'limit of pixels')
    if size > _FILE_BYTES * limits.pixels:
        raise ImageMessageError(
            f'is too long; expected at most {_FILE_BYTES * limits.pixels} bytes: send smaller '
            'frames, or raise the limit of pixels')
    if file.scans > limits.scans:
        raise ImageMessageError(
            f'takes {file.scans} scans; expected at most {limits.scans}: send baseline jpeg, or '
            'raise the limit of scans')
