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

"""Frames as pictures for a browser: palettes, the confidence map as a layer, thumbnails."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
import threading

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.console.moments import Moment
from lmsco_ros.visualization.display_range import DisplayRange
from msg_adapters.boxes import Box

_LONGEST_SIDE = 1920
_JPEG_QUALITY = 85
_MOST_KEPT = 8
_THUMBNAIL_SIDE = 72
_THUMBNAIL_MARGIN = 0.4
# Blue, green, red from cold to hot, evenly spaced.
_IRONBOW = ((0, 0, 0), (110, 0, 30), (150, 0, 130), (90, 40, 205), (10, 110, 240), (0, 190, 255),
            (255, 255, 255))
_LAYER_COLOR = np.array((255, 230, 0), np.float32)
_LAYER_STRENGTH = 0.6


def _ramp(colors: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Return a table of 256 colors through the given ones."""
    colors = np.asarray(colors, np.float64)
    places = np.linspace(0, 255, len(colors))
    return np.stack([np.interp(np.arange(256), places, colors[:, channel])
                     for channel in range(3)], axis=-1).round().astype(np.uint8)


_GRAY = np.arange(256, dtype=np.uint8)
PALETTES: dict[str, npt.NDArray[np.uint8]] = {
    'white_hot': np.repeat(_GRAY[:, None], 3, axis=1),
    'black_hot': np.repeat(_GRAY[::-1, None], 3, axis=1),
    'ironbow': _ramp(_IRONBOW),
    'inferno': np.asarray(
        cv2.applyColorMap(_GRAY[:, None], cv2.COLORMAP_INFERNO)[:, 0], np.uint8),
}
"""Colors (BGR) of the 256 brightnesses, by name."""


@dataclass(frozen=True)
class Look:
    """How a viewer wants frames to look: a name of `PALETTES`, and the layer or not."""

    palette: str = 'white_hot'
    confidence: bool = False


class Pictures:
    """
    Makes pictures of frames, each once however many look at it; safe in every thread.

    The contrast follows the frames slowly, so that nothing flickers.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._range = DisplayRange()
        self._views: OrderedDict[int, npt.NDArray[np.uint8]] = OrderedDict()
        self._files: OrderedDict[tuple[int, Look], bytes] = OrderedDict()

    def jpeg(self, moment: Moment, look: Look) -> bytes:
        """
        Return the file of a frame, at most 1920 pixels long.

        Raises
        ------
        ImageError
            When the image cannot be displayed.

        """
        with self._lock:
            key = (moment.number, look)
            if key not in self._files:
                self._files[key] = _encoded(self._drawn(moment, look))
                _shorten(self._files)
            return self._files[key]

    def thumbnail(self, moment: Moment, box: Box) -> bytes:
        """Return the file of a box and what is around it."""
        with self._lock:
            view = self._view(moment)
        margin = _THUMBNAIL_MARGIN * max(box.width, box.height)
        left, right = _pixels(box.x - margin, box.x + box.width + margin, view.shape[1])
        top, bottom = _pixels(box.y - margin, box.y + box.height + margin, view.shape[0])
        return _encoded(_limited(_colored(view[top:bottom, left:right], 'white_hot'),
                                 _THUMBNAIL_SIDE))

    def _view(self, moment: Moment) -> npt.NDArray[np.uint8]:
        if moment.number not in self._views:
            self._views[moment.number] = self._range.apply(moment.image)
            _shorten(self._views)
        return self._views[moment.number]

    def _drawn(self, moment: Moment, look: Look) -> npt.NDArray[np.uint8]:
        picture = _limited(self._view(moment), _LONGEST_SIDE)
        if look.palette != 'white_hot' or look.confidence:
            picture = _colored(picture, look.palette)
        if look.confidence and moment.confidence is not None:
            picture = _with_layer(picture, moment.confidence)
        return picture


def _colored(view: npt.NDArray[np.uint8], palette: str) -> npt.NDArray[np.uint8]:
    """Return a gray view in the colors of a palette; one in color stays as it is."""
    return view if view.ndim == 3 else PALETTES[palette][view]


def _with_layer(picture: npt.NDArray[np.uint8],
                confidence: npt.NDArray) -> npt.NDArray[np.uint8]:
    """Return the picture with the confidence map over it, stronger where it is higher."""
    height, width = picture.shape[:2]
    scores = np.nan_to_num(cv2.resize(np.asarray(confidence, np.float32), (width, height)))
    rows, columns = np.nonzero(scores > 0)
    if not rows.size:
        return picture
    part = np.s_[rows.min():rows.max() + 1, columns.min():columns.max() + 1]
    weight = _LAYER_STRENGTH * np.clip(scores[part], 0, 1)[..., None]
    mixed = picture.copy()
    mixed[part] = picture[part] * (1 - weight) + _LAYER_COLOR * weight
    return mixed


def _limited(picture: npt.NDArray[np.uint8], side: int) -> npt.NDArray[np.uint8]:
    """Return the picture, made smaller where a side is longer than allowed."""
    scale = side / max(picture.shape[:2])
    if scale >= 1:
        return picture
    size = tuple(max(1, round(scale * length)) for length in picture.shape[1::-1])
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _encoded(picture: npt.NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode('.jpg', picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()


def _pixels(start: float, end: float, limit: int) -> tuple[int, int]:
    """Return the pixels of a span inside the image, at least one."""
    first = int(np.clip(start, 0, limit - 1))
    return first, int(np.clip(np.ceil(end), first + 1, limit))


def _shorten(kept: OrderedDict) -> None:
    while len(kept) > _MOST_KEPT:
        kept.popitem(last=False)
