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


"""What the node hears: images and boxes to start on, turned into plain values."""

from __future__ import annotations

from collections.abc import Callable
import time

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PolygonStamped
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image, RegionOfInterest
from std_msgs.msg import Header

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.node.diagnostics import HealthMonitor
from lmsco_ros.node.history import NANOSECONDS
from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.worker import Frame, TrackerWorker
from msg_adapters.boxes import box_from_polygon, box_from_region
from msg_adapters.errors import MessageError
from msg_adapters.image import image_from_compressed, image_from_message

_RELIABILITY = {
    'best_effort': ReliabilityPolicy.BEST_EFFORT,
    'reliable': ReliabilityPolicy.RELIABLE,
    'system_default': ReliabilityPolicy.SYSTEM_DEFAULT,
}
_BOX_DEPTH = 10


class Inputs:
    """
    Subscriptions of an active node.

    Parameters
    ----------
    node : Node
        Owner of the subscriptions.
    settings : Settings
        Transport and quality of service of the images.
    worker : TrackerWorker
        Gets the frames and the boxes.
    monitor : HealthMonitor
        Is told of every image.
    refuse : callable
        Called with the header and the reason when a message cannot be used.

    """

    def __init__(self, node: Node, settings: Settings, worker: TrackerWorker,
                 monitor: HealthMonitor, refuse: Callable[[Header, str], None]) -> None:
        self._node = node
        self._worker = worker
        self._monitor = monitor
        self._refuse = refuse
        self._images = self._subscribe_images(settings)
        self._boxes = [
            node.create_subscription(RegionOfInterest, 'init_box', self._on_region, _BOX_DEPTH),
            node.create_subscription(PolygonStamped, 'init_box_stamped', self._on_polygon,
                                     _BOX_DEPTH),
        ]

    @property
    def image_topic(self) -> str:
        """Full name of the topic that images are expected on."""
        return self._images.topic_name

    def close(self) -> None:
        """Stop listening."""
        for subscription in [self._images, *self._boxes]:
            self._node.destroy_subscription(subscription)

    def _subscribe_images(self, settings: Settings) -> Subscription:
        qos = QoSProfile(
            history=HistoryPolicy.KEEP_LAST if settings.image_depth else HistoryPolicy.KEEP_ALL,
            depth=settings.image_depth,
            reliability=_RELIABILITY[settings.image_reliability])
        if settings.image_transport == 'raw':
            return self._node.create_subscription(Image, 'image_raw', self._on_raw, qos)
        # A remapping of image_raw has to reach the name that is made from it.
        topic = self._node.resolve_topic_name('image_raw') + '/compressed'
        return self._node.create_subscription(CompressedImage, topic, self._on_compressed, qos)

    def _on_raw(self, message: Image) -> None:
        self._take(message, image_from_message)

    def _on_compressed(self, message: CompressedImage) -> None:
        self._take(message, image_from_compressed)

    def _take(self, message: Image | CompressedImage, decode: Callable) -> None:
        received, stamp = time.monotonic(), _nanoseconds(message.header.stamp)
        if self._monitor.received(stamp):
            self._node.get_logger().warning(
                'the stamps of the images went backwards; earlier images are forgotten, '
                'tracking goes on', throttle_duration_sec=5.0)
        try:
            image = decode(message)
        except MessageError as error:
            self._refuse(message.header, str(error))
        else:
            self._worker.submit(Frame(image, stamp, received, message.header))

    def _on_region(self, region: RegionOfInterest) -> None:
        self._start(Header(), region, box_from_region, None)

    def _on_polygon(self, polygon: PolygonStamped) -> None:
        # Without a stamp there is no certain frame to start on: take the newest.
        stamp = _nanoseconds(polygon.header.stamp) or None
        self._start(polygon.header, polygon, box_from_polygon, stamp)

    def _start(self, header: Header, message: RegionOfInterest | PolygonStamped,
               read: Callable, stamp: int | None) -> None:
        try:
            box = BoundingBox(*read(message))
        except MessageError as error:
            self._refuse(header, str(error))
        else:
            self._worker.initialize(box, stamp)


def _nanoseconds(stamp: Time) -> int:
    return stamp.sec * NANOSECONDS + stamp.nanosec
