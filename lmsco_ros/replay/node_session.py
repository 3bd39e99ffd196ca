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
The real node in this process, with somebody to feed it and to listen.

The node spins in one thread and the listener in another, each with an executor of its
own, and talk over the middleware as they would between processes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import os
import queue
import threading
import time
from types import TracebackType
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
import rclpy
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from visualization_msgs.msg import ImageMarker

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.node.tracker_node import TrackerNode
from lmsco_ros.replay.errors import NodeError
from msg_adapters.boxes import polygon_from_box

NODE_NAME = 'lmsco_tracker'
OUTPUTS: Mapping[str, type] = {
    'box': PolygonStamped, 'boxes': PolygonInstanceStamped, 'status': DiagnosticArray,
    'marker': ImageMarker, 'confidence_map': Image, 'overlay': Image}
_ANSWER = ('box', 'boxes', 'status')
_DISCOVERY_SECONDS = 10.0
_POLL_SECONDS = 0.01
# Messages of one topic that wait for us, for each target that there may be.
_DEPTH = 100


@dataclass(frozen=True, eq=False)
class Heard:
    """
    One message from the node.

    Attributes
    ----------
    output : str
        Name from OUTPUTS.
    data : bytes
        The message as it came, serialized.
    received : float
        When, on the clock of `time.monotonic`.

    """

    output: str
    data: bytes
    received: float


class NodeSession:
    """
    Runs the node for one recording; use as a context manager.

    Parameters
    ----------
    parameters : mapping
        Of the node: name to value.
    outputs : iterable of str
        Names from OUTPUTS to listen to; `box`, `boxes` and `status` always are.
    compressed : bool
        Whether the images are sensor_msgs/CompressedImage.
    make_node : callable
        Makes the node; takes the arguments of TrackerNode.

    Raises
    ------
    NodeError
        When the node does not start.

    """

    def __init__(self, parameters: Mapping[str, Any], *, outputs: tuple[str, ...] = (),
                 compressed: bool = False,
                 make_node: Callable[..., TrackerNode] = TrackerNode) -> None:
        # The graph is nobody's business but ours; the user may decide otherwise.
        os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        # Not a SimpleQueue, which may wait for ever when asked to wait for a few microseconds.
        self._heard: queue.Queue[Heard] = queue.Queue()
        self._outputs = dict.fromkeys((*_ANSWER, *outputs))
        self._context = Context()
        rclpy.init(context=self._context)
        transport = 'compressed' if compressed else 'raw'
        overrides = [Parameter(name, value=value)
                     for name, value in {**parameters, 'image_transport': transport}.items()]
        # Cameras and trackers that run on this machine keep out of this namespace.
        namespace = f'/session_{os.getpid()}_{id(self):x}'
        # Whoever replays reads results and complaints, not what goes as it should.
        set_logger_level(f'{namespace[1:]}.{NODE_NAME}', LoggingSeverity.WARN)
        self._failure = ''
        self._threads: list[threading.Thread] = []
        self._executors: list[SingleThreadedExecutor] = []
        self._nodes: list[Node] = []
        try:
            self._node = _made(make_node, context=self._context, namespace=namespace,
                               parameter_overrides=overrides)
            self._nodes.append(self._node)
            if not self._node.is_active:
                raise NodeError('the node did not start; its log above says why')
            self._partner = rclpy.create_node('partner', context=self._context,
                                              namespace=namespace)
            self._nodes.append(self._partner)
            self._connect(compressed, _DEPTH * self.max_targets)
            self._spin()
            self._wait_for_discovery()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> NodeSession:
        """Return the running session."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Stop the node."""
        self.close()

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names from OUTPUTS that are listened to."""
        return tuple(self._outputs)

    @property
    def max_targets(self) -> int:
        """So many targets may there be."""
        return self._node.settings.max_targets

    def publish_image(self, message: Image | CompressedImage | bytes) -> None:
        """Send an image to the node, as a message or as its serialized bytes."""
        self._images.publish(message)

    def publish_start(self, box: BoundingBox, header: Header) -> None:
        """Ask the node to start on `box` in the image with the stamp of `header`."""
        self._starts.publish(polygon_from_box(box.as_tuple(), header))

    def next_message(self, timeout: float) -> Heard | None:
        """
        Return the next message of the node, or None when `timeout` seconds have passed.

        Raises
        ------
        NodeError
            When nothing more will come, since the node has ended or is not active any more.

        """
        try:
            return self._heard.get(timeout=max(timeout, 0.0))
        except queue.Empty:
            if self._failure:
                raise NodeError(f'the node ended: {self._failure}') from None
            if not self._node.is_active:
                raise NodeError('the node is not active any more; its log above says '
                                'why') from None
            return None

    def close(self) -> None:
        """Stop the node and the listener, and leave the graph."""
        self._context.try_shutdown()
        for thread in self._threads:
            thread.join()
        for node in self._nodes:
            node.destroy_node()
        self._nodes, self._threads = [], []

    def _connect(self, compressed: bool, depth: int) -> None:
        """Make the publishers and the subscriptions of the partner."""
        reliable = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)
        kind, topic = (CompressedImage, 'image_raw/compressed') if compressed \
            else (Image, 'image_raw')
        self._images = self._partner.create_publisher(kind, topic, reliable)
        self._starts = self._partner.create_publisher(PolygonStamped, 'init_box_stamped',
                                                      reliable)
        for output in self._outputs:
            self._partner.create_subscription(
                OUTPUTS[output], f'{NODE_NAME}/{output}', self._listener(output), reliable,
                raw=True)

    def _listener(self, output: str) -> Callable[[bytes], None]:
        return lambda data: self._heard.put(Heard(output, data, time.monotonic()))

    def _spin(self) -> None:
        for node in self._nodes:
            executor = SingleThreadedExecutor(context=self._context)
            executor.add_node(node)
            self._executors.append(executor)
            thread = threading.Thread(target=self._spin_one, args=(executor,),
                                      name=node.get_name(), daemon=True)
            thread.start()
            self._threads.append(thread)

    def _spin_one(self, executor: SingleThreadedExecutor) -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            pass
        except rclpy_implementation.RCLError as error:
            # Shutting down invalidates what the executor waits for.
            if self._context.ok():
                self._failure = str(error)
        # Whatever it was, the command that listens has to know.
        except Exception as error:  # noqa: B902
            self._failure = f'{type(error).__name__}: {error}'

    def _wait_for_discovery(self) -> None:
        """Wait until everybody hears everybody; what is said earlier gets lost."""
        deadline = time.monotonic() + _DISCOVERY_SECONDS
        topics = [f'{NODE_NAME}/{output}' for output in self._outputs]
        while not (self._images.get_subscription_count()
                   and self._starts.get_subscription_count()
                   and all(self._partner.count_publishers(topic) for topic in topics)
                   and all(self._node.count_subscribers(f'~/{output}')
                           for output in self._outputs)):
            if time.monotonic() > deadline:
                raise NodeError('the node and its partner did not find each other; check the '
                                'ROS 2 middleware settings (ROS_DOMAIN_ID, RMW_IMPLEMENTATION, '
                                'discovery range) of this terminal')
            time.sleep(_POLL_SECONDS)


def _made(make_node: Callable[..., TrackerNode], **arguments: Any) -> TrackerNode:
    """Make the node, or say what of its parameters is wrong."""
    try:
        return make_node(NODE_NAME, **arguments)
    except ParameterException as error:
        raise NodeError(f'the node does not start: {error}') from error
