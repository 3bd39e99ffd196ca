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

"""The files for viewers name topics and services that the node has, of types that they show."""

import json
from pathlib import Path
import re

import pytest
import yaml

VIEWERS = Path(__file__).resolve().parents[2] / 'config' / 'viewers'
PICTURES = {'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'}
SHOWN_BY_RVIZ = {
    'rviz_default_plugins/Image': 'sensor_msgs/msg/Image',
    'rviz_default_plugins/PoseWithCovariance': 'geometry_msgs/msg/PoseWithCovarianceStamped'}
WITHOUT_TOPIC = {'rviz_default_plugins/Axes'}


@pytest.fixture(scope='module')
def node():
    """Return the types of what a running node publishes, and the names of its services."""
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')

    from lmsco_ros.node.tracker_node import TrackerNode
    from msg_adapters.annotations import annotations_available
    context = rclpy.Context()
    rclpy.init(context=context)
    tracker = TrackerNode(context=context)
    topics = {each.topic_name: each.msg_type for each in tracker.publishers}
    services = {tracker.resolve_service_name(each.srv_name): each.srv_type
                for each in tracker.services}
    tracker.destroy_node()
    rclpy.shutdown(context=context)
    if not annotations_available():
        topics['/lmsco_tracker/annotations'] = None
    return topics, services


@pytest.fixture(scope='module')
def layout():
    return json.loads((VIEWERS / 'foxglove_layout.json').read_text())


@pytest.fixture(scope='module')
def rviz():
    return yaml.safe_load((VIEWERS / 'tracker.rviz').read_text())['Visualization Manager']


def written(kind):
    """Return the name of a message class as ROS writes it."""
    return f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'


def check_path(topics, path):
    """Check a path into a message: a topic, and fields with places and filters."""
    topic, *fields = re.findall(r'^[^.]+|(?<=\.)[a-z_]+', re.sub(r'\[[^]]*\]|\{[^}]*\}', '', path))
    name = written(topics[topic])
    for field in fields:
        package, _, kind = name.replace('sequence<', '').replace('/msg', '').partition('/')
        module = __import__(f'{package}.msg', fromlist=[kind])
        name = re.sub(r'^sequence<|(\[\d+\]|>)$', '', getattr(
            module, kind.rstrip('>')).get_fields_and_field_types()[field])
    assert name in ('string', 'double', 'float')
    return dict(re.findall(r'\{(\w+)=="(\w+)"\}', path))


def panels(layout):
    """Yield the panels that a part of a layout shows."""
    if isinstance(layout, str):
        yield layout
    else:
        assert layout['direction'] in ('row', 'column') and 0 < layout['splitPercentage'] < 100
        yield from panels(layout['first'])
        yield from panels(layout['second'])


def test_every_panel_is_in_its_place_once(layout):
    shown = list(panels(layout['layout']))
    assert sorted(shown) == sorted(layout['configById'])


def test_panels_show_what_the_node_publishes(layout, node):
    topics, services = node
    pictures = keys = 0
    for name, panel in layout['configById'].items():
        kind = name.partition('!')[0]
        if kind == 'Image':
            pictures += 1
            assert written(topics[panel['imageMode']['imageTopic']]) in PICTURES
            assert panel['imageMode'].get('annotations', {}).keys() <= topics.keys()
        elif kind in ('Plot', 'StateTransitions'):
            for path in panel['paths']:
                keys += len(check_path(topics, path['value']))
        elif kind == 'CallService':
            request = services[panel['serviceName']].Request()
            assert all(hasattr(request, field) for field in json.loads(panel['requestPayload']))
        else:
            assert kind == 'DiagnosticSummary' and panel['topicToRender'] in topics
    assert pictures == 2 and keys == 2


def test_keys_of_the_status_are_those_that_it_has(layout):
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from msg_adapters.status import FrameStatus, message_from_status
    status = message_from_status(FrameStatus('tracking', 1, 0.5, 1.0, 1.0, 0), 'tracker')
    known = {pair.key for pair in status.status[0].values}
    wanted = re.findall(r'key==\\"(\w+)\\"', json.dumps(layout))
    assert set(wanted) == {'score', 'state'} <= known


@pytest.mark.parametrize('path', [
    '/lmsco_tracker/status.status[0].velues[:]', '/lmsco_tracker/state.twist.linear.x',
    '/lmsco_tracker/stat.twist', '/lmsco_tracker/state.twist.twist'])
def test_check_of_paths_finds_mistakes(node, path):
    with pytest.raises((KeyError, AssertionError)):
        check_path(node[0], path)


def test_rviz_shows_what_the_node_publishes(rviz, node):
    topics, _ = node
    shown = [display for display in rviz['Displays'] if display['Class'] not in WITHOUT_TOPIC]
    assert len(shown) == 3
    for display in shown:
        assert written(topics[display['Topic']['Value']]) == SHOWN_BY_RVIZ[display['Class']]


def test_frame_of_rviz_is_that_of_the_bags_that_are_made(rviz):
    import inspect

    from lmsco_ros.cli.make_bag import make_bag
    default = inspect.signature(make_bag).parameters['frame_id'].default
    assert rviz['Global Options']['Fixed Frame'] == default
