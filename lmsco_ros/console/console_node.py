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

"""The node `lmsco_console`: hears camera and tracker, and speaks to the tracker by its topics."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
import functools
from pathlib import Path
import threading
from typing import Any, TYPE_CHECKING

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PointStamped, PolygonInstanceStamped, PolygonStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header, UInt32
from std_srvs.srv import SetBool, Trigger

from lmsco_ros.console.chronicle import Chronicle
from lmsco_ros.console.desk import Answer, Desk
from lmsco_ros.console.feed import Feed, Rate
from lmsco_ros.console.frames import LiveFrames
from lmsco_ros.console.moments import Assembly, Moment
from lmsco_ros.console.picture import Pictures
from lmsco_ros.console.settings import ConsoleSettings
from lmsco_ros.extras import require_extra
from lmsco_ros.replay.errors import OutputError
from msg_adapters.boxes import box_from_polygon, polygon_from_box
from msg_adapters.compressed import image_from_compressed
from msg_adapters.errors import MessageError
from msg_adapters.image import image_from_message
from msg_adapters.state import state_from_odometry
from msg_adapters.status import statuses_from_message

if TYPE_CHECKING:
    from lmsco_ros.replay.recorder import Recorder

_DEPTH = 10
_TICK_SECONDS = 0.1
_NANOSECONDS = 10 ** 9


class ConsoleNode(Node):
    """
    Between the page and ROS; decides nothing.

    Parameters
    ----------
    node_name : str
        Name, unless remapped.
    **kwargs
        As for `rclpy.node.Node`: context, parameter_overrides, ...

    Attributes
    ----------
    settings : ConsoleSettings
        Parameters as they were given.
    desk : Desk
        What the page works on.

    Raises
    ------
    rclpy.exceptions.ParameterException
        When a parameter is given a value of another type.

    """

    def __init__(self, node_name: str = 'lmsco_console', **kwargs: Any) -> None:
        super().__init__(node_name, **kwargs)
        self.settings = self._read_settings()
        self._map_wishes: set[int] = set()
        self._lock = threading.Lock()
        self._maps: Subscription | None = None
        pictures = Pictures()
        topic = self._subscribe_images()
        recorder = self._recorder = self._make_recorder(topic)
        self._feed = Feed(self.settings.history_megabytes)
        self.desk = Desk(
            lambda: LiveFrames(self._feed), Chronicle(pictures.thumbnail), pictures, self,
            Rate(), Rate(), topic, self.settings.read_only,
            recorded=None if recorder is None else lambda: recorder.count)
        self._orders: list[tuple[bool, Answer]] = []
        self._assembly = Assembly(self._deliver)
        self._listen()
        self._starts = self.create_publisher(PolygonStamped, 'init_box_stamped', _DEPTH)
        self._points = self.create_publisher(PointStamped, 'init_point', _DEPTH)
        self._selects = self.create_publisher(UInt32, 'select', _DEPTH)
        self._reset = self.create_client(Trigger, self._of_tracker('reset'))
        self._set_enabled = self.create_client(SetBool, self._of_tracker('set_enabled'))
        # It must tick while a simulated clock stands still, too.
        self.create_timer(_TICK_SECONDS, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def destroy_node(self) -> None:
        """Finish what is recorded, and take the node away."""
        if self._recorder is not None and self._recorder.count is not None:
            try:
                self._record(False)
            except OutputError as error:
                self.get_logger().error(str(error))
        super().destroy_node()

    def start(self, stamp: int, box: tuple[float, float, float, float]) -> None:
        """Publish a box to start on, with the stamp of the frame that it was drawn on."""
        self._starts.publish(polygon_from_box(box, _header(stamp)))

    def point(self, stamp: int, x: float, y: float) -> None:
        """Publish a pixel to start at, with the stamp of the frame that it was seen in."""
        self._points.publish(PointStamped(header=_header(stamp), point=Point(x=x, y=y)))

    def select(self, track_id: int) -> None:
        """Publish the number of the target to select."""
        self._selects.publish(UInt32(data=track_id))

    def reset(self, answer: Answer) -> None:
        """Call the service that drops all targets."""
        self._call(self._reset, Trigger.Request(), answer)

    def enable(self, on: bool, answer: Answer) -> None:
        """Call the service that pauses and resumes."""
        self._call(self._set_enabled, SetBool.Request(data=on), answer)

    def record(self, on: bool, answer: Answer) -> None:
        """Begin or end a recording at the next tick."""
        if self._recorder is None:
            answer(False, 'the console was started without a folder for recordings; set '
                   'record_folder')
            return
        with self._lock:
            self._orders.append((on, answer))

    def want_map(self, who: object, wanted: bool) -> None:
        """Listen to confidence maps as long as somebody wants them, from the next tick on."""
        with self._lock:
            (self._map_wishes.add if wanted else self._map_wishes.discard)(id(who))

    def _read_settings(self) -> ConsoleSettings:
        read_only = ParameterDescriptor(read_only=True)
        defaults = ConsoleSettings()
        return ConsoleSettings(**{
            name: self.declare_parameter(name, getattr(defaults, name), read_only).value
            for name in defaults.__dataclass_fields__})

    def _make_recorder(self, image_topic: str) -> Recorder | None:
        """Return what records all that a page shows, where pages may."""
        if not self.settings.record_folder:
            return None
        require_extra('cli', 'a recording', 'rosbags')
        from lmsco_ros.replay.recorder import live_topics, Recorder

        return Recorder(
            self, live_topics(image_topic, self.settings.tracker,
                              compressed=self.settings.image_transport == 'compressed'),
            lambda error: self.get_logger().error(f'the recording ends: {error}'))

    def _of_tracker(self, name: str) -> str:
        return f'{self.settings.tracker}/{name}'

    def _subscribe_images(self) -> str:
        """Listen to the camera, and return the full name of its topic."""
        if self.settings.image_transport == 'compressed':
            # A remapping of image_raw has to reach the name that is made from it.
            topic = self.resolve_topic_name('image_raw') + '/compressed'
            kind: type = CompressedImage
            decode: Callable = image_from_compressed
        else:
            topic, kind, decode = 'image_raw', Image, image_from_message
        return self.create_subscription(
            kind, topic, functools.partial(self._on_image, decode),
            qos_profile_sensor_data).topic_name

    def _listen(self) -> None:
        for kind, name, callback in ((DiagnosticArray, 'status', self._on_status),
                                     (PolygonInstanceStamped, 'boxes', self._on_box),
                                     (Odometry, 'state', self._on_state)):
            self.create_subscription(kind, self._of_tracker(name), self._guarded(callback),
                                     _DEPTH)

    def _guarded(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that tells what is wrong with a message, and goes on."""
        def wrapper(message: Any) -> None:
            try:
                callback(message)
            except MessageError as error:
                self.get_logger().warning(str(error), throttle_duration_sec=5.0)
        return wrapper

    def _on_image(self, decode: Callable, message: Image | CompressedImage) -> None:
        is_first = self.desk.images.last is None
        self.desk.images.count()
        try:
            image = decode(message)
        except MessageError as error:
            self.get_logger().warning(f'an image cannot be shown: {error}',
                                      throttle_duration_sec=5.0)
            return
        if is_first:
            height, width = image.shape[:2]
            self.get_logger().info(f'images come, {width} x {height} pixels')
        self._assembly.add_image(_stamp(message.header), image)

    def _on_status(self, message: DiagnosticArray) -> None:
        statuses = tuple(statuses_from_message(message))
        if self.desk.answers.last is None:
            self.get_logger().info(f'{self.settings.tracker} answers')
        self.desk.answers.count()
        stamp = _stamp(message.header)
        self.desk.chronicle.hear(stamp, statuses)
        self._assembly.add_statuses(stamp, statuses)

    def _on_box(self, message: PolygonInstanceStamped) -> None:
        corners = PolygonStamped(header=message.header, polygon=message.polygon.polygon)
        self._assembly.add_box(_stamp(message.header), message.polygon.id,
                               box_from_polygon(corners))

    def _on_state(self, message: Odometry) -> None:
        self._assembly.add_state(_stamp(message.header), state_from_odometry(message))

    def _on_map(self, message: Image) -> None:
        self._assembly.add_confidence(_stamp(message.header), image_from_message(message))

    def _deliver(self, moment: Moment) -> None:
        self.desk.chronicle.see(moment)
        self._feed.add(moment)

    def _tick(self) -> None:
        with self._lock:
            wanted = bool(self._map_wishes)
        if wanted and self._maps is None:
            self._maps = self.create_subscription(
                Image, self._of_tracker('confidence_map'), self._guarded(self._on_map), _DEPTH)
        elif not wanted and self._maps is not None:
            self.destroy_subscription(self._maps)
            self._maps = None
        self._assembly.with_map = wanted
        self._obey()
        self._assembly.release()

    def _obey(self) -> None:
        """Begin and end recordings, in the thread that may change what is listened to."""
        with self._lock:
            orders, self._orders = self._orders, []
        for on, answer in orders:
            try:
                answer(True, self._record(on))
            except OutputError as error:
                answer(False, str(error))

    def _record(self, on: bool) -> str:
        """Begin or end a recording, and say what came of it."""
        assert self._recorder is not None, 'others get no orders'
        if on:
            path = Path(self.settings.record_folder) / datetime.now().strftime(
                'recording_%Y%m%d_%H%M%S_%f')
            self._recorder.start(path)
            text = f'recording into {path}'
        else:
            text = f'{self._recorder.stop()} messages were recorded'
        self.get_logger().info(text)
        return text

    def _call(self, client: Any, request: Any, answer: Answer) -> None:
        if not client.service_is_ready():
            answer(False, f'nobody offers {client.service_name}; is the tracker running under the '
                   f'name {self.settings.tracker}?')
            return

        def done(future: Any) -> None:
            if future.cancelled() or future.exception() is not None:
                answer(False, f'{client.service_name} failed')
            else:
                answer(bool(future.result().success), future.result().message)
        client.call_async(request).add_done_callback(done)


def _stamp(header: Header) -> int:
    return header.stamp.sec * _NANOSECONDS + header.stamp.nanosec


def _header(stamp: int) -> Header:
    seconds, rest = divmod(stamp, _NANOSECONDS)
    return Header(stamp=Time(sec=seconds, nanosec=rest))
