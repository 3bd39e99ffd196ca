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
Boxes: regions, polygons and detections <-> four numbers; points on them.

A box is the tuple (x, y, width, height) in pixels, (x, y) its top-left corner; pixel
(0, 0) covers [0, 1) x [0, 1).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import importlib
import importlib.util
import math
from typing import Any, NamedTuple

from geometry_msgs.msg import (
    Point32, PointStamped, Polygon, PolygonInstance, PolygonInstanceStamped, PolygonStamped)
import numpy as np
from sensor_msgs.msg import RegionOfInterest
from std_msgs.msg import Header

from msg_adapters.errors import BoxMessageError


class Box(NamedTuple):
    """Axis-aligned box in pixels; (x, y) is its top-left corner."""

    x: float
    y: float
    width: float
    height: float


def box_from_region(region: RegionOfInterest) -> Box:
    """
    Return the box of a region of whole pixels.

    Raises
    ------
    BoxMessageError
        When the region is empty.

    """
    return checked_box((region.x_offset, region.y_offset, region.width, region.height))


def region_from_box(box: Sequence[float]) -> RegionOfInterest:
    """
    Return the region of whole pixels nearest to `box`.

    What lies left of or above the image is cut off: a region has no negative numbers.

    Raises
    ------
    BoxMessageError
        When nothing remains.

    """
    x, y, width, height = checked_box(box)
    left, top = max(round(x), 0), max(round(y), 0)
    right, bottom = round(x + width), round(y + height)
    if right <= left or bottom <= top:
        raise BoxMessageError(
            f'box {tuple(box)} covers no whole pixel of an image that starts at (0, 0); '
            'use a polygon, or a box inside the image')
    return RegionOfInterest(x_offset=left, y_offset=top, width=right - left,
                            height=bottom - top)


def box_from_polygon(polygon: PolygonStamped) -> Box:
    """
    Return the smallest box around the corners of a polygon, in whatever order they come.

    Raises
    ------
    BoxMessageError
        When the corners enclose no area or are not finite.

    """
    points = np.array([(point.x, point.y) for point in polygon.polygon.points])
    if not points.size:
        raise BoxMessageError('the polygon has no points; expected the four corners of a box')
    return checked_box((*points.min(axis=0), *np.ptp(points, axis=0)))


def polygon_from_box(box: Sequence[float], header: Header | None = None) -> PolygonStamped:
    """Return the corners of `box`, clockwise (as seen) from the top left."""
    corners = [Point32(x=x, y=y) for x, y in corners_of_box(box)]
    return PolygonStamped(header=header or Header(), polygon=Polygon(points=corners))


def point_from_message(message: PointStamped) -> tuple[float, float]:
    """
    Return the image position (x, y) of a point, in pixels; its z says nothing.

    Raises
    ------
    BoxMessageError
        When a number is not finite.

    """
    point = message.point.x, message.point.y
    if not all(map(math.isfinite, point)):
        raise BoxMessageError(f'the point {point} has a number that is not finite; expected '
                              '(x, y) in pixels of the image')
    return point


def instance_from_box(box: Sequence[float], track_id: int,
                      header: Header | None = None) -> PolygonInstanceStamped:
    """Return the corners of the box of a target, as `polygon_from_box` does, with its number."""
    corners = polygon_from_box(box, header)
    return PolygonInstanceStamped(header=corners.header, polygon=PolygonInstance(
        polygon=corners.polygon, id=track_id))


def corners_of_box(box: Sequence[float]) -> list[tuple[float, float]]:
    """
    Return the four corners (x, y), clockwise (as seen) from the top left.

    Raises
    ------
    BoxMessageError
        When the box is empty or not finite.

    """
    x, y, width, height = checked_box(box)
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


def detections_available() -> bool:
    """Tell whether vision_msgs, which is optional, is installed."""
    return importlib.util.find_spec('vision_msgs') is not None


class Tracked(NamedTuple):
    """
    A box that is followed.

    Attributes
    ----------
    box : (x, y, width, height)
        In pixels.
    track_id : str
        Identity of the target across frames.
    score : float
        Trust in the box, in [0, 1].
    class_id : str
        What kind of object it is, if anybody knows.

    """

    box: Sequence[float]
    track_id: str = ''
    score: float = 1.0
    class_id: str = 'target'


def detections_from_boxes(boxes: Iterable[Tracked], header: Header | None = None) -> Any:
    """
    Return a `vision_msgs/Detection2DArray` with a detection for each box.

    Parameters
    ----------
    boxes : iterable of Tracked
        Of all targets in a frame.
    header : std_msgs/Header, optional
        Stamp and frame; empty by default.

    Raises
    ------
    ImportError
        When vision_msgs is not installed.

    """
    msg = importlib.import_module('vision_msgs.msg')
    header = header or Header()
    array = msg.Detection2DArray(header=header)
    for box, track_id, score, class_id in boxes:
        x, y, width, height = checked_box(box)
        detection = msg.Detection2D(header=header, id=track_id)
        detection.bbox.center.position.x = x + width / 2
        detection.bbox.center.position.y = y + height / 2
        detection.bbox.size_x, detection.bbox.size_y = width, height
        result = msg.ObjectHypothesisWithPose()
        result.hypothesis.class_id, result.hypothesis.score = class_id, float(score)
        detection.results.append(result)
        array.detections.append(detection)
    return array


def tracked_from_detections(array: Any) -> list[Tracked]:
    """
    Return the boxes of a `vision_msgs/Detection2DArray`; rotations are ignored.

    Of several hypotheses the one with the highest score counts, one without a number as its score
    last; without any the class is empty and the score 1.

    Raises
    ------
    BoxMessageError
        When a box is empty or not finite.

    """
    return [_tracked(detection) for detection in array.detections]


def _tracked(detection: Any) -> Tracked:
    """Return one detection."""
    place, box = detection.bbox.center.position, detection.bbox
    best = max((result.hypothesis for result in detection.results),
               key=lambda hypothesis: -math.inf if math.isnan(hypothesis.score)
               else hypothesis.score, default=None)
    return Tracked(
        checked_box((place.x - box.size_x / 2, place.y - box.size_y / 2, box.size_x, box.size_y)),
        detection.id, *(1.0, '') if best is None else (float(best.score), str(best.class_id)))


def checked_box(box: Sequence[float]) -> Box:
    """
    Return `box` as floats.

    Raises
    ------
    BoxMessageError
        When it is empty or not finite.

    """
    checked = Box(*(float(value) for value in box))
    if not all(map(math.isfinite, checked)):
        raise BoxMessageError(f'box {tuple(checked)} has a number that is not finite; expected '
                              'finite pixels x, y, width, height')
    if checked.width <= 0 or checked.height <= 0:
        raise BoxMessageError(f'box {tuple(checked)} is empty; expected a positive width and '
                              'height in pixels')
    return checked
