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

"""From a decoded frame of a film to an image, without loss of gray levels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.media.false_color import without_false_color

if TYPE_CHECKING:
    from av import VideoFrame


def image_of(frame: VideoFrame) -> npt.NDArray:
    """
    Return the image of a decoded frame, turned as the film says.

    Parameters
    ----------
    frame : av.VideoFrame
        As it left the decoder.

    Returns
    -------
    ndarray, shape (H, W) uint8 | uint16 | float32, or (H, W, 3) uint8
        Gray as it was stored where the film holds gray or has more than 8 bits, of which only
        the luminance is kept; else BGR, or one channel where that shows no color.

    """
    components = frame.format.components
    if max(component.bits for component in components) > 8:
        image = _deep(frame)
    elif len(components) == 1 and components[0].is_luma:
        image = _first_plane(frame)
    else:
        # Bit for bit what OpenCV makes of a film.
        image = without_false_color(frame.to_ndarray(format='bgr24', interpolation='BICUBIC'))
    quarters = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(image, quarters)) if quarters else image


def _deep(frame: VideoFrame) -> npt.NDArray:
    """Return the luminance of a frame with more than 8 bits."""
    components = frame.format.components
    if not components[0].is_luma:
        return cv2.cvtColor(frame.to_ndarray(format='rgb48le'), cv2.COLOR_RGB2GRAY)
    if sum(component.plane == 0 for component in components) > 1:
        # Luminance and color take turns in one plane.
        return _first_plane(frame.reformat(format='gray16le'))
    return _first_plane(frame)


def _first_plane(frame: VideoFrame) -> npt.NDArray:
    """Return the values of the first plane in the order of bytes of this machine."""
    size = {8: 'u1', 32: 'f4'}.get(frame.format.components[0].bits, 'u2')
    stored = np.dtype(size).newbyteorder('>' if frame.format.name.endswith('be') else '<')
    plane = frame.planes[0]
    rows = np.frombuffer(memoryview(plane), stored).reshape(frame.height, -1)
    return rows[:, :frame.width].astype(stored.newbyteorder('='))
