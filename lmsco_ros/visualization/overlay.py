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

"""The image as a person wants to see it: 8 bit, with box, score and state."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.visualization.display_range import DisplayRange

Color = tuple[int, int, int]

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_WHITE: Color = (255, 255, 255)
_BLACK: Color = (0, 0, 0)
_SUBPIXEL_BITS = 4
_MARGIN = 50
_STATE_COLORS: dict[TrackState, Color] = {
    TrackState.TRACKING: (110, 230, 60),
    TrackState.UNCERTAIN: (30, 180, 255),
    TrackState.LOST: (70, 70, 255),
}


def state_color(state: TrackState) -> Color:
    """Return the color (blue, green, red) that stands for `state` in every picture."""
    return _STATE_COLORS[state]


def draw_overlay(image: npt.NDArray, result: TrackResult | None, *,
                 label: str = '') -> npt.NDArray[np.uint8]:
    """
    Draw box, score and state on an 8-bit view of the image.

    Parameters
    ----------
    image : ndarray, shape (H, W) of any real type or (H, W, 3) uint8 (BGR)
        Left unchanged. Frames of a stream should pass a :class:`DisplayRange` first, so
        that their contrast does not flicker; other images get a stretch of their own.
    result : TrackResult or None
        What to draw; None draws the label alone.
    label : str
        Text for the lower left corner, such as the frame number.

    Returns
    -------
    ndarray, shape (H, W, 3), uint8 (BGR)
        Same size as the image.

    """
    view = DisplayRange().apply(image)
    canvas = np.asarray(
        view.copy() if view.ndim == 3 else cv2.cvtColor(view, cv2.COLOR_GRAY2BGR), np.uint8)
    if result is not None:
        draw_box(canvas, result.box, state_color(result.state),
                 dashed=result.state is TrackState.LOST)
        _draw_status(canvas, result)
    if label:
        _draw_label(canvas, label)
    return canvas


def draw_targets(image: npt.NDArray, results: Mapping[int, TrackResult], selected: int, *,
                 label: str = '') -> npt.NDArray[np.uint8]:
    """
    Draw the selected target as `draw_overlay` does, and the others with number and score.

    Parameters
    ----------
    image : ndarray
        As for `draw_overlay`.
    results : mapping of int to TrackResult
        By the numbers of the targets, which are written beside the boxes with their scores;
        where there was only one so far, its box stands alone.
    selected : int
        Of which target state and score are told in the corner.
    label : str
        Text for the lower left corner.

    Returns
    -------
    ndarray, shape (H, W, 3), uint8 (BGR)
        Same size as the image.

    """
    canvas = draw_overlay(image, results.get(selected), label=label)
    for number, result in results.items():
        if number != selected:
            draw_box(canvas, result.box, state_color(result.state),
                     dashed=result.state is TrackState.LOST)
        if max(results) > 1:
            _draw_number(canvas, number, result)
    return canvas


def draw_box(canvas: npt.NDArray[np.uint8], box: BoundingBox, color: Color, *,
             dashed: bool = False, thickness: int = 0) -> None:
    """
    Draw the outline of `box` to a fraction of a pixel.

    Parameters
    ----------
    canvas : ndarray, shape (H, W, 3), uint8
        Drawn into.
    box : BoundingBox
        May lie outside of the canvas.
    color : (int, int, int)
        Blue, green, red.
    dashed : bool
        Draw dashes instead of lines.
    thickness : int
        In pixels; 0 chooses it in proportion to the canvas.

    """
    height, width = canvas.shape[:2]
    # OpenCV puts the center of the first pixel at 0, boxes put its corner there. Edges
    # that are out of sight stay so, but come near enough for fixed-point coordinates.
    left, right = np.clip([box.x, box.x + box.width], -_MARGIN, width + _MARGIN) - 0.5
    top, bottom = np.clip([box.y, box.y + box.height], -_MARGIN, height + _MARGIN) - 0.5
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    thickness = thickness or max(1, round(min(height, width) / 300))
    edges = list(zip(corners, corners[1:] + corners[:1]))
    if dashed:
        edges = [dash for edge in edges for dash in _dashes(*edge, 4.0 * thickness + 2)]
    if thickness > 1:
        # A dark rim keeps the color visible over warm, white regions.
        for start, end in edges:
            _line(canvas, start, end, _BLACK, thickness + 2)
    for start, end in edges:
        _line(canvas, start, end, color, thickness)


def _dashes(start: tuple[float, float], end: tuple[float, float], length: float,
            ) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Cut a line into dashes of about `length` pixels with gaps as long between them."""
    first, last = np.asarray(start), np.asarray(end)
    pieces = 2 * max(1, round(float(np.hypot(*(last - first))) / length / 2)) + 1
    stops = [first + (last - first) * i / pieces for i in range(pieces + 1)]
    return [(tuple(stops[i]), tuple(stops[i + 1])) for i in range(0, pieces, 2)]


def _line(canvas: npt.NDArray[np.uint8], start: tuple[float, float],
          end: tuple[float, float], color: Color, thickness: int) -> None:
    first, last = (tuple(round(float(v) * (1 << _SUBPIXEL_BITS)) for v in point)
                   for point in (start, end))
    cv2.line(canvas, first, last, color, thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def _text_scale(canvas: npt.NDArray[np.uint8]) -> float:
    """Return a font scale that stays readable on small sensors and in proportion."""
    return max(0.33, min(canvas.shape[:2]) / 900)


def _draw_status(canvas: npt.NDArray[np.uint8], result: TrackResult) -> None:
    """Write state and score with a bar, in the upper corner that the box leaves free."""
    text, scale = f'{result.state.name} {result.score:.2f}', _text_scale(canvas)
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, 1)
    pad, bar = max(2, round(6 * scale)), max(2, round(5 * scale))
    plate = (width + 2 * pad, height + bar + 3 * pad)
    left = 0
    if result.box.intersection(BoundingBox(0, 0, *plate)) > 0:
        left = max(0, canvas.shape[1] - plate[0])
    _darken(canvas, left, 0, *plate)
    color = state_color(result.state)
    _write(canvas, text, (left + pad, pad + height), scale, color)
    top, full = 2 * pad + height, plate[0] - 2 * pad
    filled = round(full * min(max(result.score, 0.0), 1.0))
    canvas[top:top + bar, left + pad:left + pad + full] = 70
    canvas[top:top + bar, left + pad:left + pad + filled] = color


def _draw_number(canvas: npt.NDArray[np.uint8], number: int, result: TrackResult) -> None:
    """Write number and score of a target at the lower left corner of its box, or inside."""
    text, scale = f'{number} {result.score:.2f}', _text_scale(canvas)
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, 1)
    pad = max(2, round(4 * scale))
    plate = width + 2 * pad, height + 2 * pad
    left = min(max(0, round(result.box.x)), max(0, canvas.shape[1] - plate[0]))
    top = min(max(0, round(result.box.y + result.box.height) + 2),
              max(0, canvas.shape[0] - plate[1]))
    _darken(canvas, left, top, *plate)
    _write(canvas, text, (left + pad, top + pad + height), scale, state_color(result.state))


def _draw_label(canvas: npt.NDArray[np.uint8], label: str) -> None:
    """Write `label` into the lower left corner."""
    scale = _text_scale(canvas)
    (width, height), below = cv2.getTextSize(label, _FONT, scale, 1)
    pad = max(2, round(6 * scale))
    top = max(0, canvas.shape[0] - height - below - 2 * pad)
    _darken(canvas, 0, top, width + 2 * pad, canvas.shape[0] - top)
    _write(canvas, label, (pad, canvas.shape[0] - pad - below), scale, _WHITE)


def _write(canvas: npt.NDArray[np.uint8], text: str, origin: tuple[int, int],
           scale: float, color: Color) -> None:
    cv2.putText(canvas, text, origin, _FONT, scale, color, max(1, round(scale)), cv2.LINE_AA)


def _darken(canvas: npt.NDArray[np.uint8], left: int, top: int, width: int,
            height: int) -> None:
    """Dim a rectangle so that text on it can be read over any scene."""
    plate = canvas[top:top + height, left:left + width]
    plate[...] = plate * 0.35
