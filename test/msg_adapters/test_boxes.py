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

"""Boxes survive the way through regions, polygons, markers and detections."""

import math
import sys
from types import ModuleType, SimpleNamespace

from geometry_msgs.msg import Point, Point32, PointStamped, Polygon, PolygonStamped
from hypothesis import given, strategies as st
import numpy as np
import pytest
from sensor_msgs.msg import RegionOfInterest
from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker

from msg_adapters.boxes import (
    Box, box_from_polygon, box_from_region, detections_available, detections_from_boxes,
    instance_from_box, point_from_message, polygon_from_box, region_from_box, Tracked,
    tracked_from_detections)
from msg_adapters.errors import BoxMessageError
from msg_adapters.markers import box_from_marker, marker_from_box, marker_removal

HEADER = Header(frame_id='thermal')
SIDES = st.floats(0.5, 5000)
BOXES = st.builds(Box, st.floats(-5000, 5000), st.floats(-5000, 5000), SIDES, SIDES)
WHOLE_BOXES = st.builds(Box, *[st.integers(0, 10000)] * 2, *[st.integers(1, 10000)] * 2)


@given(WHOLE_BOXES)
def test_region_round_trip(box):
    assert box_from_region(region_from_box(box)) == box


@given(BOXES)
def test_region_is_the_part_that_can_be_expressed(box):
    try:
        region = region_from_box(box)
    except BoxMessageError:
        assert round(box.x + box.width) <= max(round(box.x), 0) \
            or round(box.y + box.height) <= max(round(box.y), 0)
        return
    assert abs(region.x_offset - max(box.x, 0)) <= 0.5
    assert abs(region.x_offset + region.width - box.x - box.width) <= 0.5
    assert abs(region.y_offset - max(box.y, 0)) <= 0.5
    assert abs(region.y_offset + region.height - box.y - box.height) <= 0.5


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), st.floats())
def test_point_is_where_it_was_clicked(x, y, z):
    assert point_from_message(PointStamped(point=Point(x=x, y=y, z=z))) == (x, y)


@pytest.mark.parametrize('wrong', [math.nan, math.inf])
def test_point_that_is_not_finite_is_refused(wrong):
    for point in (Point(x=wrong), Point(y=wrong)):
        with pytest.raises(BoxMessageError, match='not finite; expected .x, y. in pixels'):
            point_from_message(PointStamped(point=point))


def test_empty_region_is_refused():
    with pytest.raises(BoxMessageError, match='empty.*expected a positive width'):
        box_from_region(RegionOfInterest(x_offset=3, y_offset=4, width=0, height=5))


@given(BOXES)
def test_polygon_round_trip(box):
    # Points are single precision.
    np.testing.assert_allclose(box_from_polygon(polygon_from_box(box)), box, atol=2e-3)


@given(BOXES, st.permutations(range(4)))
def test_order_of_the_corners_does_not_matter(box, order):
    polygon = polygon_from_box(box)
    shuffled = PolygonStamped()
    shuffled.polygon.points = [polygon.polygon.points[i] for i in order]
    assert box_from_polygon(shuffled) == box_from_polygon(polygon)


def test_corners_run_clockwise_from_top_left():
    polygon = polygon_from_box((10.0, 20.0, 30.0, 40.0), HEADER)
    assert [(p.x, p.y) for p in polygon.polygon.points] == [
        (10, 20), (40, 20), (40, 60), (10, 60)]
    assert polygon.header == HEADER


@pytest.mark.parametrize('points, reason', [
    ([], 'no points'),
    ([(1, 1)], 'empty'),
    ([(1, 1), (5, 1)], 'empty'),
    ([(1, 1), (float('nan'), 4)], 'not finite'),
    ([(float('inf'), 1), (3, 4)], 'not finite'),
])
def test_polygons_that_are_no_boxes_are_refused(points, reason):
    polygon = PolygonStamped(polygon=Polygon(
        points=[Point32(x=float(x), y=float(y)) for x, y in points]))
    with pytest.raises(BoxMessageError, match=reason):
        box_from_polygon(polygon)


@given(BOXES, st.integers(-2 ** 31, 2 ** 31 - 1))
def test_marker_round_trip(box, marker_id):
    marker = marker_from_box(box, (0, 1, 0.5), namespace='n', marker_id=marker_id,
                             header=HEADER)
    np.testing.assert_allclose(box_from_marker(marker), box, atol=1e-9)
    removal = marker_removal(namespace='n', marker_id=marker_id, header=HEADER)
    assert (removal.ns, removal.id, removal.header) == (marker.ns, marker.id, marker.header)
    assert box_from_marker(removal) is None


def test_marker_is_a_colored_outline():
    marker = marker_from_box((1, 2, 3, 4), (0.25, 0.5, 1), namespace='n', line_width=3)
    assert marker.type == ImageMarker.POLYGON and marker.action == ImageMarker.ADD
    color = marker.outline_color
    assert (color.r, color.g, color.b, color.a, marker.scale) == (0.25, 0.5, 1, 1, 3)


def test_other_markers_are_no_boxes():
    with pytest.raises(BoxMessageError, match='no box'):
        box_from_marker(ImageMarker(type=ImageMarker.CIRCLE))


def _stand_in() -> ModuleType:
    """Return the few fields of vision_msgs, which need not be installed, that are used."""
    def detection(header, id):  # noqa: A002
        center = SimpleNamespace(position=SimpleNamespace(x=0.0, y=0.0), theta=0.0)
        return SimpleNamespace(header=header, id=id, results=[], bbox=SimpleNamespace(
            center=center, size_x=0.0, size_y=0.0))

    messages = ModuleType('vision_msgs.msg')
    messages.Detection2DArray = lambda header: SimpleNamespace(header=header, detections=[])
    messages.Detection2D = detection
    messages.ObjectHypothesisWithPose = lambda: SimpleNamespace(
        hypothesis=SimpleNamespace(class_id='', score=0.0))
    return messages


@pytest.fixture(scope='module')
def vision_msgs():
    """Use the real messages where they are installed."""
    with pytest.MonkeyPatch.context() as patch:
        if not detections_available():
            patch.setitem(sys.modules, 'vision_msgs', ModuleType('vision_msgs'))
            patch.setitem(sys.modules, 'vision_msgs.msg', _stand_in())
        yield


@given(box=BOXES)
def test_detections_round_trip(vision_msgs, box):
    array = detections_from_boxes([Tracked(box, '7', 0.5)], HEADER)
    back, = tracked_from_detections(array)
    np.testing.assert_allclose(back.box, box, atol=1e-9)
    assert back[1:] == ('7', 0.5, 'target')
    detection, = array.detections
    assert (detection.id, detection.header, array.header) == ('7', HEADER, HEADER)
    assert detection.results[0].hypothesis.score == 0.5


def test_every_box_is_a_detection_of_its_own(vision_msgs):
    array = detections_from_boxes(
        [Tracked((1, 2, 3, 4), '7', 0.5), Tracked((5, 6, 7, 8), '9', 0.25, 'dog')], HEADER)
    assert tracked_from_detections(array) == [
        ((1, 2, 3, 4), '7', 0.5, 'target'), ((5, 6, 7, 8), '9', 0.25, 'dog')]
    assert [(found.id, found.results[0].hypothesis.score, found.results[0].hypothesis.class_id)
            for found in array.detections] == [('7', 0.5, 'target'), ('9', 0.25, 'dog')]


@given(box=BOXES, track_id=st.integers(0, 2 ** 63 - 1))
def test_instance_is_the_polygon_with_a_number(box, track_id):
    instance, polygon = instance_from_box(box, track_id, HEADER), polygon_from_box(box, HEADER)
    assert (instance.header, instance.polygon.polygon) == (polygon.header, polygon.polygon)
    assert instance.polygon.id == track_id


def test_best_hypothesis_of_a_detection_counts(vision_msgs):
    array = detections_from_boxes([Tracked((1, 2, 3, 4), '7', 0.2, 'cat')] * 2)
    first, second = array.detections
    first.results = first.results + detections_from_boxes(
        [Tracked((1, 2, 3, 4), '', 0.6, 'dog')]).detections[0].results
    second.results = []
    assert [found[2:] for found in tracked_from_detections(array)] == [(0.6, 'dog'), (1.0, '')]


def test_hypothesis_without_a_score_hides_no_other(vision_msgs):
    array = detections_from_boxes(
        [Tracked((1, 2, 3, 4), '7', score, kind)
         for score, kind in ((math.nan, 'cat'), (0.3, 'dog'), (math.nan, 'bat'))])
    found = array.detections[0]
    found.results = [each.results[0] for each in array.detections]
    assert tracked_from_detections(array)[0][2:] == (0.3, 'dog')


@pytest.mark.parametrize('size', [0.0, -1.0, float('nan'), float('inf')])
def test_detection_without_an_area_is_refused(vision_msgs, size):
    array = detections_from_boxes([Tracked((1, 2, 3, 4))])
    array.detections[0].bbox.size_x = size
    with pytest.raises(BoxMessageError):
        tracked_from_detections(array)


def test_no_box_is_no_detection(vision_msgs):
    assert tracked_from_detections(detections_from_boxes([])) == []


def test_vision_msgs_is_optional(monkeypatch):
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    monkeypatch.setitem(sys.modules, 'vision_msgs.msg', None)
    assert not detections_available()
    with pytest.raises(ImportError):
        detections_from_boxes([Tracked((0, 0, 1, 1))])
