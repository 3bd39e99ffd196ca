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

"""Who publishes images, why nothing is heard of them, and what would make them heard."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rclpy.node import Node
from rclpy.qos import qos_check_compatible, QoSCompatibility, QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

# More names than a person reads in one line.
_MOST_TOPICS = 5
_TRANSPORTS = {'sensor_msgs/msg/Image': 'raw', 'sensor_msgs/msg/CompressedImage': 'compressed'}
_SUFFIX = '/compressed'


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
        Other topics with images, and how to hear them.

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
    """
    Return where else images are offered, the likeliest first, each with how to hear them.

    The node's own topics are left out. What is told beside a topic are the arguments that the
    node has to be started with.

    Parameters
    ----------
    node : Node
        Knows the graph.
    topic : str
        Where images are expected.
    image_type : str
        Type that is subscribed to.

    """
    own = f'{node.get_fully_qualified_name()}/'
    offered = [(name, kind) for name, kinds in node.get_topic_names_and_types()
               for kind in kinds if kind in _TRANSPORTS
               and (name, kind) != (topic, image_type) and not name.startswith(own)
               and node.count_publishers(name)]
    base = _base(topic, image_type)
    offered.sort(key=lambda offer: _distance(base, *offer))
    return [f'{name} (to hear it: {_remedy(name, kind, base, image_type)})'
            for name, kind in offered]


def _base(topic: str, kind: str) -> str:
    """Return the name that a topic of the transport is made from."""
    return topic.removesuffix(_SUFFIX) if _TRANSPORTS[kind] == 'compressed' else topic


def _distance(base: str, topic: str, kind: str) -> tuple[bool, bool, str]:
    """Order topics: the same images first, then those of the same name elsewhere."""
    found = _base(topic, kind)
    return found != base, found.rpartition('/')[2] != base.rpartition('/')[2], topic


def _remedy(topic: str, kind: str, base: str, expected: str) -> str:
    """
    Return the arguments that make the node hear a topic.

    Parameters
    ----------
    topic, kind : str
        What is offered.
    base : str
        What `image_raw` means at the moment.
    expected : str
        Type that is subscribed to.

    """
    arguments = [] if kind == expected else [f'-p image_transport:={_TRANSPORTS[kind]}']
    found = _base(topic, kind)
    if _TRANSPORTS[kind] == 'compressed' and found == topic:
        # It has a name of its own, such as that of compressedDepth.
        arguments.append(f'-r {base}{_SUFFIX}:={topic}')
    elif found != base:
        arguments.append(f'-r image_raw:={found}')
    return ' '.join(arguments)


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
