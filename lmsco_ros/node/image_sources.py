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

"""Who publishes on the image topic, and why nothing is heard of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rclpy.node import Node
from rclpy.qos import qos_check_compatible, QoSCompatibility, QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

# More names than a person reads in one line.
_MOST_TOPICS = 5


class ImageSource(NamedTuple):
    """A publisher, by its node, and why it is not heard; empty when it should be."""

    node: str
    objection: str


def image_sources(publishers: Iterable[TopicEndpointInfo], image_type: str,
                  wanted: QoSProfile) -> list[ImageSource]:
    """
    Return the publishers of a topic, each with the reason why it is not heard.

    Parameters
    ----------
    publishers : iterable of TopicEndpointInfo
        As the graph tells of them.
    image_type : str
        Type that is subscribed to, such as ``sensor_msgs/msg/Image``.
    wanted : QoSProfile
        Quality of service of the subscription.

    """
    return [ImageSource(_full_name(info), _objection(info, image_type, wanted))
            for info in publishers]


def unheard_warning(sources: Sequence[ImageSource], topic: str) -> str:
    """Name the publishers that cannot be heard, and why; empty when there are none."""
    unheard = [f'{source.node} {source.objection}' for source in sources if source.objection]
    return f'no image on {topic} is received from {" nor from ".join(unheard)}' if unheard else ''


def stale_message(seconds: float, topic: str, sources: Sequence[ImageSource],
                  elsewhere: Sequence[str]) -> str:
    """
    Say that no image comes, and what the likely causes are.

    Parameters
    ----------
    seconds : float
        Since the last image, or since the node began to wait.
    topic : str
        Where images are expected.
    sources : sequence of ImageSource
        The publishers there.
    elsewhere : sequence of str
        Other topics with images.

    """
    opening = f'no image for {seconds:.0f} s on {topic}: '
    if not sources:
        found = ', '.join(elsewhere[:_MOST_TOPICS]) or 'no other topic either'
        return (f'{opening}nobody publishes there; check that the camera runs (same '
                'ROS_DOMAIN_ID) and the topic name (remap image_raw); images are offered on '
                f'{found}')
    unheard = unheard_warning(sources, topic)
    if all(source.objection for source in sources):
        return opening + unheard
    heard = ', '.join(source.node for source in sources if not source.objection)
    return (f'{opening}{heard} could be heard but sends nothing that arrives; check that the '
            'camera is not paused, the network, and for large images the shared-memory profile '
            'of the camera' + (f'; {unheard}' if unheard else ''))


def other_image_topics(node: Node, topic: str, image_type: str) -> list[str]:
    """Return the topics, other than `topic` and the node's own, where images are offered."""
    own = f'{node.get_fully_qualified_name()}/'
    return [name for name, kinds in node.get_topic_names_and_types()
            if image_type in kinds and name != topic and not name.startswith(own)
            and node.count_publishers(name)]


def _full_name(info: TopicEndpointInfo) -> str:
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def _objection(info: TopicEndpointInfo, image_type: str, wanted: QoSProfile) -> str:
    if info.topic_type != image_type:
        return (f'(it publishes {info.topic_type}, expected {image_type}; see the parameter '
                'image_transport)')
    compatibility, reason = qos_check_compatible(info.qos_profile, wanted)
    if compatibility == QoSCompatibility.ERROR:
        return (f'(incompatible QoS: {reason.removeprefix("ERROR: ").rstrip("; ")}; see the '
                'parameter image_reliability)')
    return ''
