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

from collections.abc import Callable, Sequence
import contextlib
import functools
import time
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, PolygonStamped
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, RegionOfInterest
from std_msgs.msg import Header, UInt32

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.node.detection_policy import Candidate
from lmsco_ros.node.diagnostics import HealthMonitor, Problem
from lmsco_ros.node.faults import cause
from lmsco_ros.node.guarded_node import GuardedNode
from lmsco_ros.node.history import NANOSECONDS
from lmsco_ros.node.image_sources import (image_sources, other_image_topics, stale_message,
                                          unheard_warning)
from lmsco_ros.node.outcome import PendingFrame, Place
from lmsco_ros.node.parameters import Settings
from lmsco_ros.node.received import ReceivedImage, WhileThereIsRoom
from lmsco_ros.node.worker import TrackerWorker
from msg_adapters.boxes import (
    box_from_polygon, box_from_region, detections_available, point_from_message,
    tracked_from_detections)
from msg_adapters.compressed import image_from_compressed
from msg_adapters.errors import MessageError
from msg_adapters.image import image_from_message
from msg_adapters.status import Level

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
    node : GuardedNode
        Owner of the subscriptions.
    settings : Settings
        Transport, quality of service, limits and edges of the images.
    worker : TrackerWorker
        Gets the frames and the boxes.
    monitor : HealthMonitor
        Is told of every image.
    refuse : callable
        Called with the header and the reason when a message cannot be used.
    calibrate : callable
        Called with every camera_info.

    """

    def __init__(self, node: GuardedNode, settings: Settings, worker: TrackerWorker,
                 monitor: HealthMonitor, refuse: Callable[..., None],
                 calibrate: Callable[[CameraInfo], None]) -> None:
        self._node = node
        self._worker = worker
        self._monitor = monitor
        self._refuse = refuse
        self._crop = settings.crop
        self._policy = settings.detection_policy
        with contextlib.ExitStack() as made:
            self._image_type, self._images = self._subscribe_images(settings)
            made.callback(node.destroy_subscription, self._images)
            made.callback(node.destroy_subscription, node.create_subscription(
                CameraInfo, 'camera_info', calibrate, QoSProfile(
                    depth=1, reliability=_RELIABILITY[settings.image_reliability])))
            for kind, topic, callback in (
                    (RegionOfInterest, 'init_box', self._on_region),
                    (PolygonStamped, 'init_box_stamped', self._on_polygon),
                    (PointStamped, 'init_point', self._on_point),
                    (UInt32, 'select', self._on_select), *self._detector()):
                made.callback(node.destroy_subscription, node.create_subscription(
                    kind, topic, callback, max(_BOX_DEPTH, settings.max_targets)))
            self._made = made.pop_all()

    @property
    def image_topic(self) -> str:
        """Full name of the topic that images are expected on."""
        return self._images.topic_name

    def problem(self, timeout: float) -> Problem | None:
        """Return why no image came for `timeout` seconds, or who cannot be heard."""
        silence = self._monitor.silence()
        sources = image_sources(self._node.get_publishers_info_by_topic(self.image_topic),
                                self._image_type, self._images.qos_profile)
        if silence > timeout:
            elsewhere = other_image_topics(self._node, self.image_topic, self._image_type)
            return Problem(Level.STALE, stale_message(
                silence, self.image_topic, sources, elsewhere))
        unheard = unheard_warning(sources, self.image_topic)
        return Problem(Level.WARN, unheard) if unheard else None

    def close(self) -> None:
        """Stop listening."""
        self._made.close()

    def _subscribe_images(self, settings: Settings) -> tuple[str, Subscription]:
        """Return the name of the image type, and the subscription."""
        qos = QoSProfile(
            history=HistoryPolicy.KEEP_LAST if settings.image_depth else HistoryPolicy.KEEP_ALL,
            depth=settings.image_depth,
            reliability=_RELIABILITY[settings.image_reliability])
        topic, kind, decode = 'image_raw', Image, image_from_message
        if settings.image_transport == 'compressed':
            # A remapping of image_raw has to reach the name that is made from it.
            topic = self._node.resolve_topic_name('image_raw') + '/compressed'
            kind = CompressedImage
            decode = functools.partial(image_from_compressed, limits=settings.decoding_limits)
        on_unheard = self._node.guarded(f'an event of {topic}', self._on_unheard)
        subscription = self._node.create_subscription(
            kind, topic, lambda serialized: self._take(serialized, kind, decode), qos, raw=True,
            callback_group=WhileThereIsRoom(self._worker.has_room),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=on_unheard, incompatible_type=on_unheard))
        return f'sensor_msgs/msg/{kind.__name__}', subscription

    def _on_unheard(self, event: object) -> None:
        """Tell at once when somebody offers images that cannot be received."""
        sources = image_sources(self._node.get_publishers_info_by_topic(self.image_topic),
                                self._image_type, self._images.qos_profile)
        # The graph may know of the publisher later than the middleware does; the health
        # report, which comes every second, names it then.
        warning = unheard_warning(sources, self.image_topic)
        if warning:
            self._node.get_logger().warning(warning)

    def _take(self, serialized: bytes, kind: type[Image] | type[CompressedImage],
              decode: Callable) -> None:
        received = time.monotonic()
        try:
            # It is what both begin with; the rest is read when its turn comes.
            header = deserialize_message(serialized, Header)
        except Exception as error:  # noqa: B902
            self._refuse(Header(), f'what came in on {self.image_topic} does not begin as a '
                         f'{kind.__name__} does: {cause(error)}')
            return
        stamp = _nanoseconds(header.stamp)
        if self._monitor.received(stamp):
            self._node.get_logger().warning(
                'the stamps of the images went backwards; earlier images are forgotten, '
                'tracking goes on', throttle_duration_sec=5.0)
        image = ReceivedImage(serialized, kind, decode, self._crop)
        self._worker.submit(PendingFrame(image, stamp, received, header))

    def _on_region(self, region: RegionOfInterest) -> None:
        self._start(Header(), None, lambda: self._place(box_from_region(region)))

    def _on_polygon(self, polygon: PolygonStamped) -> None:
        # Without a stamp there is no certain frame to start on: take the newest.
        stamp = _nanoseconds(polygon.header.stamp) or None
        self._start(polygon.header, stamp, lambda: self._place(box_from_polygon(polygon)))

    def _on_point(self, point: PointStamped) -> None:
        # Viewers stamp a click with their own clock: then the newest frame is meant.
        stamp = _nanoseconds(point.header.stamp)
        self._start(point.header, stamp if stamp and self._worker.keeps(stamp) else None,
                    lambda: self._crop.inwards_point(point_from_message(point)))

    def _detector(self) -> list[tuple[type, str, Callable]]:
        """Return the subscription for a detector, where its messages are installed."""
        if not detections_available():
            return []
        from vision_msgs.msg import Detection2DArray
        return [(Detection2DArray, 'init_detections', self._on_detections)]

    def _on_detections(self, message: Any) -> None:
        worker, policy = self._worker, self._policy
        try:
            found = [Candidate(self._place(each.box), each.score, each.class_id)
                     for each in tracked_from_detections(message)]
        except (MessageError, LMSCOError) as error:
            self._refuse(message.header, str(error), start=True)
            return
        if worker.image_size is None:
            # Before the first image nobody knows where its center is; detectors go on talking.
            return
        box = policy.pick(found, worker.results, worker.image_size)
        if box is not None:
            worker.offer(box, _nanoseconds(message.header.stamp) or None,
                         lambda results: policy.wants(box, results))

    def _on_select(self, message: UInt32) -> None:
        ids = tuple(self._worker.results)
        if message.data in ids:
            self._worker.select(message.data)
            return
        known = ', '.join(map(str, ids)) or 'none; publish a box on init_box'
        self._refuse(Header(), f'there is no target {message.data} to select; followed are '
                     f'{known}')

    def _place(self, box: Sequence[float]) -> BoundingBox:
        """Return a box of the full image as the tracker sees it."""
        return self._crop.inwards(BoundingBox(*box))

    def _start(self, header: Header, stamp: int | None, read: Callable[[], Place]) -> None:
        try:
            place = read()
        except (MessageError, LMSCOError) as error:
            self._refuse(header, str(error), start=True)
        else:
            self._worker.initialize(place, stamp)


def _nanoseconds(stamp: Time) -> int:
    return stamp.sec * NANOSECONDS + stamp.nanosec
