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
Images of the transport `compressedDepth`: a png file behind a head of 12 bytes.

16-bit counts are stored as they are. Of floating-point numbers the inverse is stored, as 16-bit
counts c = a / depth + b; a and b stand in the head, and 0 is no value.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
import struct

import numpy as np
import numpy.typing as npt

from msg_adapters.errors import ImageMessageError
from msg_adapters.jpeg_file import JPEG_START
from msg_adapters.png_file import PNG_START

__all__ = ['DepthCoding', 'HEAD_BYTES', 'is_compressed_depth', 'read_depth_coding']

# Kind of coding, a and b, in the byte order of all machines that run ROS 2.
_HEAD = struct.Struct('<iff')
HEAD_BYTES = _HEAD.size
_COUNTS, _NUMBERS = ('16uc1', 'mono16'), '32fc1'


@dataclass(frozen=True)
class DepthCoding:
    """
    How the counts of the png become an image.

    Attributes
    ----------
    inverse : (float, float) or None
        a and b of the inverse; None when the counts are the image.

    """

    inverse: tuple[float, float] | None

    def decode(self, counts: npt.NDArray) -> npt.NDArray:
        """
        Return the image of the counts.

        Parameters
        ----------
        counts : ndarray, shape (H, W) uint16
            Pixels of the png.

        Returns
        -------
        ndarray, shape (H, W) uint16 or float32
            NaN where a number is not known.

        Raises
        ------
        ImageMessageError
            When the counts are something else.

        """
        if counts.ndim != 2 or counts.dtype != np.uint16:
            raise ImageMessageError(
                'of the transport compressedDepth holds other pixels than 16-bit gray; subscribe '
                'to the raw image or to a png of the transport compressed')
        if self.inverse is None:
            return counts
        a, b = (np.float32(value) for value in self.inverse)
        distance = counts - b
        distance[(counts == 0) | (distance == 0)] = np.nan
        return a / distance


def is_compressed_depth(data: memoryview, declared: str) -> bool:
    """
    Return whether a message is of this transport, by its format or by its bytes.

    A file of counts that some publishers send under that format without the head is none.
    """
    declares = 'compresseddepth' in declared.lower()
    if data[:len(PNG_START)] == PNG_START or data[:len(JPEG_START)] == JPEG_START:
        return declares and _encoding(declared) == _NUMBERS
    return declares or data[HEAD_BYTES:HEAD_BYTES + len(PNG_START)] == PNG_START


def read_depth_coding(data: memoryview, declared: str) -> DepthCoding:
    """
    Return how the png behind the head is to be read.

    Parameters
    ----------
    data : memoryview of bytes
        Head and png.
    declared : str
        The format of the message, such as "16UC1; compressedDepth png".

    Raises
    ------
    ImageMessageError
        When no png stands there, or the format does not tell what the counts are.

    """
    if data[HEAD_BYTES:HEAD_BYTES + len(PNG_START)] != PNG_START:
        raise ImageMessageError(
            'of the transport compressedDepth holds no png; expected a png behind 12 bytes: set '
            'the parameter "format" of the publisher to png (rvl is not read), or use the raw '
            'image topic')
    encoding = _encoding(declared)
    if encoding in _COUNTS:
        return DepthCoding(None)
    _, a, b = _HEAD.unpack(data[:HEAD_BYTES])
    if encoding != _NUMBERS:
        raise ImageMessageError(
            'of the transport compressedDepth does not say what its pixels are; expected a '
            'format such as "16UC1; compressedDepth png" or "32FC1; compressedDepth png"')
    if not (math.isfinite(a) and math.isfinite(b) and a > 0):
        raise ImageMessageError(
            f'of the transport compressedDepth is quantized by {a:g} and {b:g}; expected finite '
            'numbers, the first above 0: check the parameters of the publisher')
    return DepthCoding((a, b))


def _encoding(declared: str) -> str:
    """Return the encoding in front of the format's semicolon."""
    return declared.split(';')[0].strip().lower()
