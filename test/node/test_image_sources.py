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


"""A camera that is not heard is named, with the reason, in the log and in the diagnostics."""

import shlex
from unittest.mock import Mock

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, Image

from lmsco_ros.node.image_sources import (ImageSource, other_image_topics, stale_message,
                                          unheard_warning)
from msg_adapters.status import diagnoses_from_message, Level

HEARD, DEAF = ImageSource('/camera', ''), ImageSource('/rig/eye', '(incompatible QoS: so)')


@pytest.mark.parametrize('sources, elsewhere, words', [
    ([], [], ['nobody publishes', 'remap image_raw', 'no other topic']),
    ([], ['/a/image', '/b/image'], ['nobody publishes', '/a/image, /b/image']),
    ([DEAF], [], ['/rig/eye (incompatible QoS: so)']),
    ([HEARD], [], ['/camera could be heard', 'paused', 'network', 'shared-memory']),
    ([HEARD, DEAF], [], ['/camera could be heard', '/rig/eye (incompatible']),
])
def test_silence_is_explained(sources, elsewhere, words):
    message = stale_message(4.2, '/image_raw', sources, elsewhere)
    assert message.startswith('no image for 4 s on /image_raw: ')
    assert all(word in message for word in words), message


def test_only_who_is_not_heard_is_named():
    assert unheard_warning([HEARD], '/image_raw') == ''
    assert '/camera' not in unheard_warning([HEARD, DEAF], '/image_raw')


@pytest.fixture
def camera(graph):
    """Return a node of another participant, as a camera driver is."""
    context = Context()
    context.init()
    node = Node('eye', namespace='rig', context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def diagnosis_with(graph, health, word):
    """Wait for a diagnosis that holds a word."""
    graph.spin_until(lambda: health and word in health[-1].status[0].message)
    diagnosis, = diagnoses_from_message(health[-1])
    return diagnosis


def test_incompatible_publisher_is_named_at_once_and_in_the_diagnostics(graph, camera, capfd):
    written = []

    def is_named():
        """Return whether what a person sees in the terminal names the publisher and the remedy."""
        written.append(capfd.readouterr().err)
        return all(word in ''.join(written) for word in ('/rig/eye', 'image_reliability'))

    graph.start_tracker(image_reliability='reliable', no_image_timeout=3600.0)
    health = graph.listen(DiagnosticArray, '/diagnostics')
    deaf = camera.create_publisher(Image, '/image_raw', qos_profile_sensor_data)
    graph.spin_until(is_named)
    diagnosis = diagnosis_with(graph, health, '/rig/eye')
    assert diagnosis.level == Level.WARN
    assert 'Best effort publisher and reliable subscription' in diagnosis.message
    camera.destroy_publisher(deaf)
    graph.spin_until(lambda: '/rig/eye' not in health[-1].status[0].message)
    assert diagnoses_from_message(health[-1])[0].level == Level.OK


def test_publisher_of_another_type_is_named_when_images_are_missing(graph, camera):
    camera.create_publisher(CompressedImage, '/image_raw', 5)
    camera.create_publisher(Image, '/rig/image', 5)
    graph.start_tracker(no_image_timeout=0.1)
    health = graph.listen(DiagnosticArray, '/diagnostics')
    diagnosis = diagnosis_with(graph, health, '/rig/eye')
    assert diagnosis.level == Level.STALE
    assert 'sensor_msgs/msg/CompressedImage, expected sensor_msgs/msg/Image' in diagnosis.message


def test_silence_is_stale_and_points_to_other_images(graph, camera):
    camera.create_publisher(Image, '/rig/image', 5)
    graph.start_tracker(no_image_timeout=0.1)
    health = graph.listen(DiagnosticArray, '/diagnostics')
    diagnosis = diagnosis_with(graph, health, '/rig/image')
    assert diagnosis.level == Level.STALE
    # The node's own pictures are no camera.
    assert 'nobody publishes' in diagnosis.message and 'overlay' not in diagnosis.message


RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'


def offers(offered, topic, kind):
    """Return what is said of topics with publishers, and of one without."""
    node = Mock(**{
        'get_fully_qualified_name.return_value': '/lmsco_tracker',
        'get_topic_names_and_types.return_value': [
            (name, [kind]) for name, kind in [('/nobody/image_raw', RAW), *offered]]})
    node.count_publishers = lambda name: not name.startswith('/nobody')
    return other_image_topics(node, topic, kind)


@pytest.mark.parametrize('offered, topic, kind, remedy', [
    (('/cam/image_raw/compressed', COMPRESSED), '/cam/image_raw', RAW,
     '-p image_transport:=compressed'),
    (('/cam/image_raw', RAW), '/cam/image_raw/compressed', COMPRESSED,
     '-p image_transport:=raw'),
    (('/cam/image_raw', RAW), '/image_raw', RAW, '-r image_raw:=/cam/image_raw'),
    (('/cam/image_raw/compressed', COMPRESSED), '/image_raw/compressed', COMPRESSED,
     '-r image_raw:=/cam/image_raw'),
    (('/cam/image_raw/compressed', COMPRESSED), '/image_raw', RAW,
     '-p image_transport:=compressed -r image_raw:=/cam/image_raw'),
    (('/cam/depth/compressedDepth', COMPRESSED), '/cam/depth', RAW,
     '-p image_transport:=compressed -r /cam/depth/compressed:=/cam/depth/compressedDepth'),
    (('/jpeg', COMPRESSED), '/image_raw/compressed', COMPRESSED,
     '-r /image_raw/compressed:=/jpeg'),
])
def test_images_elsewhere_are_told_with_what_would_make_them_heard(offered, topic, kind, remedy):
    assert offers([offered], topic, kind) == [f'{offered[0]} (to hear it: {remedy})']


def test_likeliest_images_are_told_first_and_the_own_never():
    found = offers([('/a/overlay', RAW), ('/lmsco_tracker/overlay', RAW), ('/b/image_raw', RAW),
                    ('/image_raw/compressed', COMPRESSED), ('/points', 'sensor_msgs/msg/Imu')],
                   '/image_raw', RAW)
    assert [offer.split()[0] for offer in found] == [
        '/image_raw/compressed', '/b/image_raw', '/a/overlay']


@pytest.mark.parametrize('name, kind, values', [
    ('/cam/image_raw/compressed', CompressedImage, {}),
    ('/cam/image_raw/compressedDepth', CompressedImage, {}),
    ('/elsewhere/image_raw/compressed', CompressedImage, {}),
    ('/elsewhere/image_raw', Image, {}),
    ('/cam/image_raw', Image, {'image_transport': 'compressed'}),
])
def test_node_hears_what_it_named_when_it_does_as_it_said(graph, camera, name, kind, values):
    publisher = camera.create_publisher(kind, name, 5)
    arguments = ['--ros-args', '-r', 'image_raw:=/cam/image_raw']
    node = graph.start_tracker(cli_args=arguments, no_image_timeout=0.1, **values)
    health = graph.listen(DiagnosticArray, '/diagnostics')
    message = diagnosis_with(graph, health, f'{name} (to hear it: ').message
    remedy = message.partition(f'{name} (to hear it: ')[2].partition(')')[0]
    graph.executor.remove_node(node)
    graph.trackers.remove(node)
    node.destroy_node()
    # Of two rules for one name the first counts.
    graph.start_tracker(cli_args=['--ros-args', *shlex.split(remedy), *arguments[1:]])
    graph.spin_until(lambda: publisher.get_subscription_count() > 0)
