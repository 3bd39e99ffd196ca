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
Boxes with their words as `foxglove_msgs/ImageAnnotations`, which viewers draw over the image.

The package foxglove_msgs is optional. Its versions differ in what an annotation may hold
besides; all have what is set here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import importlib
import importlib.util
from typing import Any, NamedTuple

from std_msgs.msg import Header

from msg_adapters.boxes import corners_of_box

_FONT_PIXELS = 14.0
_GAP_PIXELS = 4.0
_WHITE = (1.0, 1.0, 1.0, 1.0)
_PLATE = (0.0, 0.0, 0.0, 0.75)
_NOTHING = (0.0, 0.0, 0.0, 0.0)


class Annotated(NamedTuple):
    """
    A box that is drawn with words above it.

    Attributes
    ----------
    box : (x, y, width, height)
        In pixels.
    text : str
        Above its top-left corner.
    color : (red, green, blue)
        Of its outline, each in [0, 1].

    """

    box: Sequence[float]
    text: str
    color: Sequence[float]


def annotations_available() -> bool:
    """Tell whether foxglove_msgs, which is optional, is installed."""
    return importlib.util.find_spec('foxglove_msgs') is not None


def annotations_from_boxes(boxes: Iterable[Annotated], *, line_width: float = 2.0,
                           header: Header | None = None) -> Any:
    """
    Return a `foxglove_msgs/ImageAnnotations`; it takes the place of the one before.

    Parameters
    ----------
    boxes : iterable of Annotated
        All that is to be seen in a frame; without any, nothing is.
    line_width : float
        In pixels.
    header : std_msgs/Header, optional
        Its stamp tells viewers which image is meant; empty by default.

    Raises
    ------
    BoxMessageError
        When a box is empty or not finite.
    ImportError
        When foxglove_msgs is not installed.

    """
    msg = importlib.import_module('foxglove_msgs.msg')
    stamp = (header or Header()).stamp
    annotations = msg.ImageAnnotations()
    for box, text, color in boxes:
        corners = corners_of_box(box)
        annotations.points.append(msg.PointsAnnotation(
            timestamp=stamp, type=msg.PointsAnnotation.LINE_LOOP,
            points=[msg.Point2(x=x, y=y) for x, y in corners],
            outline_color=_color(msg, (*color, 1.0)), fill_color=_color(msg, _NOTHING),
            thickness=float(line_width)))
        left, top = corners[0]
        annotations.texts.append(msg.TextAnnotation(
            timestamp=stamp, position=msg.Point2(x=left, y=top - _GAP_PIXELS), text=text,
            font_size=_FONT_PIXELS, text_color=_color(msg, _WHITE),
            background_color=_color(msg, _PLATE)))
    # Versions that have one for all need no stamp beside each box.
    if hasattr(annotations, 'timestamp'):
        annotations.timestamp = stamp
    return annotations


def _color(msg: Any, color: Sequence[float]) -> Any:
    red, green, blue, alpha = map(float, color)
    return msg.Color(r=red, g=green, b=blue, a=alpha)
