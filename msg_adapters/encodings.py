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
Encodings of images: how pixels lie in a message, and the array that becomes of them.

The names are those of `sensor_msgs/image_encodings` and of OpenCV's types, and some that drivers
use beside them. Of encodings with a plane or channel of luminance that is the array; 16-bit color
becomes gray, since the tracker reads color of 8 bits only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from types import MappingProxyType

import cv2
import numpy as np
import numpy.typing as npt

from msg_adapters.errors import ImageMessageError

__all__ = ['ALIASES', 'ENCODINGS', 'fitting_encoding', 'Layout', 'layout_of', 'without_alpha']

_Conversion = Callable[[npt.NDArray], npt.NDArray]


def _same(pixels: npt.NDArray) -> npt.NDArray:
    return pixels


def _no_way_back(image: npt.NDArray) -> npt.NDArray:
    raise ImageMessageError(f'{image.dtype} pixels cannot be brought into this encoding; '
                            'expected one that keeps them')


@dataclass(frozen=True)
class Layout:
    """
    How the pixels of an encoding lie, and what becomes of them.

    Attributes
    ----------
    dtype : numpy.dtype
        Of one value in the message.
    channels : int
        Values of a pixel that lie side by side.
    to_array : callable
        Returns the array for the pixels, (H, W) or (H, W, channels).
    to_pixels : callable
        The way back, where there is one.
    chroma : float
        Rows behind the luminance, for each row of it.
    smallest_side : int
        Pixels that the conversion needs in each direction.

    """

    dtype: np.dtype
    channels: int = 1
    to_array: _Conversion = _same
    to_pixels: _Conversion = _no_way_back
    chroma: float = 0
    smallest_side: int = 1

    @property
    def pixel_bytes(self) -> int:
        """Bytes from one pixel to the next."""
        return self.dtype.itemsize * self.channels

    @property
    def reversible(self) -> bool:
        """Whether arrays can be written in this encoding, and none of their values is lost."""
        return self.to_pixels is not _no_way_back

    def rows(self, height: int) -> int:
        """Return the rows of a message for an image of so many."""
        return height + int(height * self.chroma)


def without_alpha(pixels: npt.NDArray) -> npt.NDArray:
    """
    Return pixels as the tracker reads them.

    Parameters
    ----------
    pixels : ndarray, shape (H, W), or (H, W, 3 or 4) uint8 or uint16
        Color as BGR or BGRA.

    Returns
    -------
    ndarray, shape (H, W), or (H, W, 3) uint8
        Gray as it is; color of 16 bits as gray.

    """
    if pixels.ndim == 2:
        return pixels
    if pixels.dtype == np.uint16:
        return cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY if pixels.shape[2] == 3
                            else cv2.COLOR_BGRA2GRAY)
    return pixels if pixels.shape[2] == 3 else cv2.cvtColor(pixels, cv2.COLOR_BGRA2BGR)


def _plain(dtype: npt.DTypeLike, channels: int = 1) -> Layout:
    return Layout(np.dtype(dtype), channels, _same, _same)


def _converted(dtype: npt.DTypeLike, channels: int, code: int) -> Layout:
    return Layout(np.dtype(dtype), channels, partial(cv2.cvtColor, code=code))


def _luminance(place: int) -> Layout:
    """Return the layout of pairs of luminance and chroma."""
    return Layout(np.dtype(np.uint8), 2, partial(cv2.extractChannel, coi=place))


def _luminance_plane(chroma: float) -> Layout:
    return Layout(np.dtype(np.uint8), chroma=chroma)


def _mosaic(dtype: npt.DTypeLike, code: int) -> Layout:
    return Layout(np.dtype(dtype), to_array=partial(cv2.cvtColor, code=code), smallest_side=3)


def _widened(pixels: npt.NDArray) -> npt.NDArray:
    return pixels.astype(np.int16)


_BAYER = {'rggb': cv2.COLOR_BayerBG2GRAY, 'bggr': cv2.COLOR_BayerRG2GRAY,
          'gbrg': cv2.COLOR_BayerGR2GRAY, 'grbg': cv2.COLOR_BayerGB2GRAY}

ENCODINGS = MappingProxyType({
    'mono8': _plain(np.uint8),
    'mono16': _plain(np.uint16),
    '8UC1': _plain(np.uint8),
    '16UC1': _plain(np.uint16),
    '8SC1': Layout(np.dtype(np.int8), to_array=_widened),
    '16SC1': _plain(np.int16),
    '32SC1': _plain(np.int32),
    '32FC1': _plain(np.float32),
    '64FC1': _plain(np.float64),
    'bgr8': _plain(np.uint8, 3),
    'rgb8': Layout(np.dtype(np.uint8), 3, partial(cv2.cvtColor, code=cv2.COLOR_RGB2BGR),
                   partial(cv2.cvtColor, code=cv2.COLOR_BGR2RGB)),
    '8UC3': _plain(np.uint8, 3),
    'bgra8': _converted(np.uint8, 4, cv2.COLOR_BGRA2BGR),
    'rgba8': _converted(np.uint8, 4, cv2.COLOR_RGBA2BGR),
    '8UC4': _converted(np.uint8, 4, cv2.COLOR_BGRA2BGR),
    'bgr16': _converted(np.uint16, 3, cv2.COLOR_BGR2GRAY),
    'rgb16': _converted(np.uint16, 3, cv2.COLOR_RGB2GRAY),
    '16UC3': _converted(np.uint16, 3, cv2.COLOR_BGR2GRAY),
    'bgra16': _converted(np.uint16, 4, cv2.COLOR_BGRA2GRAY),
    'rgba16': _converted(np.uint16, 4, cv2.COLOR_RGBA2GRAY),
    '16UC4': _converted(np.uint16, 4, cv2.COLOR_BGRA2GRAY),
    'yuv422': _luminance(1),
    'uyvy': _luminance(1),
    'yuv422_yuy2': _luminance(0),
    'yuyv': _luminance(0),
    'nv12': _luminance_plane(1 / 2),
    'nv21': _luminance_plane(1 / 2),
    'i420': _luminance_plane(1 / 2),
    'yv12': _luminance_plane(1 / 2),
    'nv16': _luminance_plane(1),
    'nv61': _luminance_plane(1),
    'nv24': _luminance_plane(2),
    'nv42': _luminance_plane(2),
    **{f'bayer_{order}8': _mosaic(np.uint8, code) for order, code in _BAYER.items()},
    **{f'bayer_{order}16': _mosaic(np.uint16, code) for order, code in _BAYER.items()},
})
"""Layout of each encoding; where several fit an array, the first is its own."""

ALIASES = MappingProxyType({
    **dict.fromkeys(('grey', 'gray', 'grey8', 'gray8', 'y8', 'y800'), 'mono8'),
    # 10 to 14 bits of a value in two bytes; packed ones have rows too short for it.
    **dict.fromkeys(('grey16', 'gray16', 'y16', 'y10', 'y12', 'y14', 'mono10', 'mono12',
                     'mono14'), 'mono16'),
    'yuy2': 'yuyv',
})
"""Further spellings, in lower case; capital letters make no difference in any name."""

_BY_SPELLING = {**{name.lower(): layout for name, layout in ENCODINGS.items()},
                **{alias: ENCODINGS[name] for alias, name in ALIASES.items()}}


def layout_of(encoding: str) -> Layout:
    """
    Return the layout of an encoding.

    Parameters
    ----------
    encoding : str
        One of the table or of the further spellings, in capital letters or not.

    Raises
    ------
    ImageMessageError
        When it is none of them.

    """
    spelling = encoding.strip(' \0').lower()
    if spelling in _BY_SPELLING:
        return _BY_SPELLING[spelling]
    near = get_close_matches(spelling[:20], _BY_SPELLING, 1)
    raise ImageMessageError(
        f'image encoding "{encoding[:60]}" is not supported'
        + (f' (the nearest name is {near[0]})' if near else '')
        + f'; expected one of {", ".join(ENCODINGS)}: set it in the camera driver, or convert to '
        'one channel')


def fitting_encoding(image: npt.NDArray, encoding: str) -> str:
    """
    Return the encoding of a message that keeps an array.

    Parameters
    ----------
    image : ndarray
        What has to be kept.
    encoding : str
        The wanted one; empty for the first that fits.

    Raises
    ------
    ImageMessageError
        When none, or not the wanted one, fits.

    """
    channels = 1 if image.ndim == 2 else image.shape[2] if image.ndim == 3 else 0
    fitting = [name for name, layout in ENCODINGS.items() if image.size and layout.reversible
               and (layout.dtype, layout.channels) == (image.dtype, channels)]
    if not fitting:
        raise ImageMessageError(
            f'no encoding for {image.dtype} pixels in an array of shape {image.shape}; expected '
            '(H, W) uint8, uint16, int16, int32, float32 or float64, or (H, W, 3) uint8: convert '
            'the image first')
    if encoding and encoding not in fitting:
        raise ImageMessageError(
            f'encoding "{encoding}" does not fit {image.dtype} pixels in an array of shape '
            f'{image.shape}; expected {" or ".join(fitting)}')
    return encoding or fitting[0]
