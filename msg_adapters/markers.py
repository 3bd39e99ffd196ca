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

"""Markers: boxes <-> `visualization_msgs/ImageMarker` for image viewers."""

from __future__ import annotations

from collections.abc import Sequence

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import ImageMarker

from msg_adapters.boxes import Box, checked_box, corners_of_box
from msg_adapters.errors import BoxMessageError


def marker_from_box(box: Sequence[float], color: Sequence[float], *, namespace: str,
                    marker_id: int = 0, line_width: float = 2.0,
                    header: Header | None = None) -> ImageMarker:
    """
    Return a marker that draws the outline of a box.

    Parameters
    ----------
    box : (x, y, width, height)
        In pixels.
    color : (red, green, blue)
        Each in [0, 1].
    namespace, marker_id
        Identity of the marker: a later one of the same identity takes its place.
    line_width : float
        In pixels.
    header : std_msgs/Header, optional
        Stamp and frame; empty by default.

    Raises
    ------
    BoxMessageError
        When the box is empty or not finite.

    """
    red, green, blue = color
    return ImageMarker(
        header=header or Header(), ns=namespace, id=marker_id, type=ImageMarker.POLYGON,
        action=ImageMarker.ADD, scale=float(line_width),
        outline_color=ColorRGBA(r=float(red), g=float(green), b=float(blue), a=1.0),
        points=[Point(x=x, y=y) for x, y in corners_of_box(box)])


def marker_removal(*, namespace: str, marker_id: int = 0,
                   header: Header | None = None) -> ImageMarker:
    """Return the marker that takes away the one of the same namespace and id."""
    return ImageMarker(header=header or Header(), ns=namespace, id=marker_id,
                       type=ImageMarker.POLYGON, action=ImageMarker.REMOVE)


def box_from_marker(marker: ImageMarker) -> Box | None:
    """
    Return the box that a marker draws, or None when it takes one away.

    Raises
    ------
    BoxMessageError
        When the marker draws something else than a box.

    """
    if marker.action == ImageMarker.REMOVE:
        return None
    if marker.type != ImageMarker.POLYGON or len(marker.points) != 4:
        raise BoxMessageError(
            f'the marker (type {marker.type}, {len(marker.points)} points) is no box; expected '
            f'type {ImageMarker.POLYGON} (polygon) with four points')
    start, end = marker.points[0], marker.points[2]
    return checked_box((start.x, start.y, end.x - start.x, end.y - start.y))
