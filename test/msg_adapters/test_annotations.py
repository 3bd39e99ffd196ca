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

"""Annotations as every version of foxglove_msgs holds them, whether or not it is installed."""

import sys
from types import ModuleType

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from std_msgs.msg import Header

from msg_adapters.annotations import Annotated, annotations_from_boxes
from msg_adapters.errors import BoxMessageError

HEADER = Header(frame_id='thermal')
HEADER.stamp.sec, HEADER.stamp.nanosec = 17, 250
RED = (1.0, 0.0, 0.0)
COMMON = {
    'Point2': 'float64 x\nfloat64 y',
    'Color': 'float64 r\nfloat64 g\nfloat64 b\nfloat64 a',
    'KeyValuePair': 'string key\nstring value',
    'CircleAnnotation': 'builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\n'
                        'float64 diameter',
    'PointsAnnotation': 'builtin_interfaces/Time timestamp\nuint8 LINE_LOOP=2\nuint8 type\n'
                        'foxglove_msgs/Point2[] points\nfoxglove_msgs/Color outline_color\n'
                        'foxglove_msgs/Color[] outline_colors\nfoxglove_msgs/Color fill_color\n'
                        'float64 thickness',
    'TextAnnotation': 'builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\n'
                      'string text\nfloat64 font_size\nfoxglove_msgs/Color text_color\n'
                      'foxglove_msgs/Color background_color',
}
LISTS = ('foxglove_msgs/CircleAnnotation[] circles\nfoxglove_msgs/PointsAnnotation[] points\n'
         'foxglove_msgs/TextAnnotation[] texts')
VERSIONS = {
    'of Jazzy': {**COMMON, 'ImageAnnotations': LISTS},
    'with one stamp': {**COMMON, 'ImageAnnotations':
                       f'builtin_interfaces/Time timestamp\n{LISTS}\n'
                       'foxglove_msgs/KeyValuePair[] metadata'},
}


class Package:
    """The messages of one version: made as rclpy's are, and serialized as they define it."""

    def __init__(self, definitions):
        self.store = get_typestore(Stores.ROS2_JAZZY)
        added = {}
        for name, text in definitions.items():
            added.update(get_types_from_msg(text, f'foxglove_msgs/msg/{name}'))
        self.store.register(added)
        self.module = ModuleType('foxglove_msgs.msg')
        for name in definitions:
            setattr(self.module, name, self._maker(f'foxglove_msgs/msg/{name}'))

    def written_and_read(self, message):
        """Return what a listener gets of a message."""
        kind = 'foxglove_msgs/msg/ImageAnnotations'
        return self.store.deserialize_cdr(self.store.serialize_cdr(message, kind), kind)

    def _maker(self, name):
        """Return what makes messages whose fields begin with nothing in them."""
        _, fields = self.store.fielddefs[name]

        class Made(self.store.types[name]):
            def __init__(made, **given):  # noqa: N805
                empty = {field: self._empty(*definition) for field, definition in fields}
                assert given.keys() <= empty.keys()
                super().__init__(**{**empty, **given})
        return Made

    def _empty(self, kind, definition):
        """Return the value that a field begins with."""
        if kind is Nodetype.NAME:
            if definition in self.store.types and definition.startswith('foxglove_msgs'):
                return getattr(self.module, definition.rpartition('/')[2])()
            return self.store.types[definition](0, 0)
        if kind is Nodetype.SEQUENCE:
            return []
        return {'string': '', 'float64': 0.0}.get(definition[0], 0)


@pytest.fixture(params=VERSIONS.values(), ids=VERSIONS)
def foxglove(request, monkeypatch):
    package = Package(request.param)
    monkeypatch.setitem(sys.modules, 'foxglove_msgs', ModuleType('foxglove_msgs'))
    monkeypatch.setitem(sys.modules, 'foxglove_msgs.msg', package.module)
    return package


def test_boxes_are_closed_lines_with_words_above_them(foxglove):
    heard = foxglove.written_and_read(annotations_from_boxes([
        Annotated((10, 12, 8, 6), '1 tracking 0.75', RED),
        Annotated((30.5, 2, 4, 5), '2 uncertain 0.40', (0.0, 1.0, 0.0))],
        line_width=3, header=HEADER))
    first, second = heard.points
    assert first.type == 2 and first.thickness == 3.0
    assert [(point.x, point.y) for point in first.points] == [
        (10, 12), (18, 12), (18, 18), (10, 18)]
    assert (first.outline_color.r, first.outline_color.g, first.outline_color.a) == (1, 0, 1)
    assert first.fill_color.a == 0 and second.outline_color.g == 1
    assert [text.text for text in heard.texts] == ['1 tracking 0.75', '2 uncertain 0.40']
    assert heard.texts[1].position.x == 30.5 and heard.texts[1].position.y < 2
    assert heard.texts[0].font_size > 0 and heard.texts[0].text_color.a == 1
    assert heard.circles == []


def test_stamp_is_that_of_the_image(foxglove):
    message = annotations_from_boxes([Annotated((1, 2, 3, 4), '', RED)], header=HEADER)
    stamped = [message.points[0], message.texts[0]]
    if hasattr(message, 'timestamp'):
        stamped.append(message)
    assert all((each.timestamp.sec, each.timestamp.nanosec) == (17, 250) for each in stamped)


def test_without_boxes_nothing_is_drawn(foxglove):
    heard = foxglove.written_and_read(annotations_from_boxes([], header=HEADER))
    assert heard.points == heard.texts == []


@pytest.mark.parametrize('box', [(1, 2, 0, 4), (float('nan'), 2, 3, 4)])
def test_boxes_without_an_area_are_refused(foxglove, box):
    with pytest.raises(BoxMessageError):
        annotations_from_boxes([Annotated(box, '', RED)])
