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

"""A bag through the real node, and its answers beside the original messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
import time

from geometry_msgs.msg import PolygonStamped
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Writer
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.replay.bag_images import (
    choose_connection, COMPRESSED, open_bag, serialized_stamp)
from lmsco_ros.replay.bag_maker import create_bag, require_free
from lmsco_ros.replay.errors import SourceError
from lmsco_ros.replay.node_session import Heard, NODE_NAME, NodeSession, OUTPUTS
from lmsco_ros.replay.player import Exchange, Player
from lmsco_ros.replay.storage import Storage
from msg_adapters.boxes import box_from_polygon

MARKS_TOPIC = '/init_box_stamped'
# While the node tracks one frame, the next one is on its way; the start is waited for.
_AHEAD = 1
_LINGER_SECONDS = 0.3


@dataclass(frozen=True)
class ReplayPlan:
    """
    What is to be played and how.

    Attributes
    ----------
    bag, output : Path
        Recording, and the new bag.
    storage : Storage
        File format of the new bag.
    box : BoundingBox or None
        Target in the first image; None: the boxes that the bag has on `init_box_stamped`.
    topic : str
        Image topic; empty when there is only one.
    rate : float
        Speed relative to the recording; 0 is as fast as the node takes every frame.
    frames : int or None
        Only so many images.
    parameters : mapping
        Of the node.
    outputs : tuple of str
        What to record of the node besides box and status.

    """

    bag: Path
    output: Path
    storage: Storage
    box: BoundingBox | None
    topic: str
    rate: float
    frames: int | None
    parameters: Mapping[str, object]
    outputs: tuple[str, ...]


def replay_bag(plan: ReplayPlan, on_begin: Callable[[int], None],
               on_frame: Callable[[], None]) -> list[Exchange]:
    """
    Play a bag through the node and record the answers beside the original messages.

    Parameters
    ----------
    plan : ReplayPlan
        What to play.
    on_begin : callable
        Called once with the number of images.
    on_frame : callable
        Called for each image that was sent.

    Returns
    -------
    list of Exchange
        One for each image.

    Raises
    ------
    ReplayError
        When the bag cannot be read or written, or the node refuses.

    """
    require_free(plan.output)
    with open_bag(plan.bag) as reader:
        images = choose_connection(reader, plan.bag, plan.topic)
        if not images.msgcount:
            raise SourceError(f'{plan.bag} has no message on {images.topic}')
        parameters = {'image_reliability': 'reliable', **plan.parameters,
                      'frame_policy': 'latest' if plan.rate else 'all'}
        with NodeSession(parameters, outputs=plan.outputs,
                         compressed=images.msgtype == COMPRESSED) as session, \
                create_bag(plan.output, plan.storage) as writer:
            on_begin(min(images.msgcount, plan.frames or images.msgcount))
            recorder = _Recorder(writer, reader, images.topic, session.outputs, plan.rate)
            player = Player(session, recorder.on_heard)
            _play(plan, reader, images, player, recorder, on_frame)
    return player.exchanges()


def _play(plan: ReplayPlan, reader: AnyReader, images: Connection, player: Player,
          recorder: _Recorder, on_frame: Callable[[], None]) -> None:
    """Send the images at their pace and copy everything else."""
    pace = _Pace(plan.rate)
    last = _last_moment(reader, images, plan.frames)
    sent = 0
    for connection, logged, data in reader.messages(stop=last + 1):
        if connection.topic == images.topic:
            stamp = serialized_stamp(data)
            if plan.rate:
                player.listen_until(pace.moment(logged))
            else:
                player.settle(_AHEAD if sent > 1 else 0)
            if not sent and plan.box is not None:
                player.start(plan.box, stamp)
            recorder.copy(connection, logged, data)
            player.send(stamp, data)
            sent += 1
            on_frame()
        else:
            if plan.box is None and connection.topic == MARKS_TOPIC:
                player.start(_marked(data), serialized_stamp(data))
            recorder.copy(connection, logged, data)
    if plan.rate:
        player.finish()
    else:
        player.settle(0)
    # Pictures of the last frame come after its box.
    player.listen_until(time.monotonic() + _LINGER_SECONDS)


def _last_moment(reader: AnyReader, images: Connection, frames: int | None) -> int:
    """Return when the last wanted image was recorded, or the bag ends."""
    if frames is None or frames >= images.msgcount:
        return reader.end_time
    *_, last = islice((logged for _, logged, _ in reader.messages([images])), frames)
    return last


def _marked(data: bytes) -> BoundingBox:
    """Return the box of a serialized message that asks for a start."""
    return BoundingBox(*box_from_polygon(deserialize_message(data, PolygonStamped)))


class _Pace:
    """Moments of the present for moments of the recording."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._first: tuple[int, float] | None = None

    def moment(self, logged: int) -> float:
        """Return when to play what was recorded at `logged`, in nanoseconds."""
        if self._first is None:
            self._first = (logged, time.monotonic())
        return self._first[1] + (logged - self._first[0]) * 1e-9 / self._rate


class _Recorder:
    """
    Writes the new bag.

    Answers come after their image by what the node took, on the clock of the recording:
    at twice the rate twice as much of it passes, at rate 0 none.
    """

    def __init__(self, writer: Writer, reader: AnyReader, image_topic: str,
                 outputs: tuple[str, ...], rate: float) -> None:
        self._writer = writer
        self._image_topic = image_topic
        self._rate = rate
        self._logged: dict[int, int] = {}
        store = get_typestore(Stores.ROS2_JAZZY)
        topics = {output: f'/{NODE_NAME}/{output}' for output in outputs}
        self._answers = {
            output: writer.add_connection(topic, _type_name(OUTPUTS[output]), typestore=store)
            for output, topic in topics.items()}
        # Answers of an earlier replay make room for ours.
        self._copies = {
            connection.id: _copy_connection(writer, reader, connection)
            for connection in reader.connections if connection.topic not in topics.values()}

    def copy(self, connection: Connection, logged: int, data: bytes) -> None:
        """Write an original message."""
        if connection.topic == self._image_topic:
            self._logged[serialized_stamp(data)] = logged
        if connection.id in self._copies:
            self._writer.write(self._copies[connection.id], logged, data)

    def on_heard(self, heard: Heard, stamp: int, seconds: float) -> None:
        """Write what the node says about the image with `stamp`, `seconds` after it."""
        # One more, for viewers that would sort what comes at the same time.
        moment = self._logged[stamp] + round(1e9 * self._rate * seconds) + 1
        self._writer.write(self._answers[heard.output], moment, heard.data)


def _type_name(message_type: type) -> str:
    """Return the name of a message class, such as std_msgs/msg/Header."""
    return f'{message_type.__module__.split(".")[0]}/msg/{message_type.__name__}'


def _copy_connection(writer: Writer, reader: AnyReader, connection: Connection) -> Connection:
    """Add a topic as it was: type definition, quality of service and all."""
    definition = {'msgdef': connection.msgdef.data, 'rihs01': connection.digest}
    if not all(definition.values()):
        definition = {'typestore': reader.typestore}
    return writer.add_connection(
        connection.topic, connection.msgtype, **definition,
        serialization_format=connection.ext.serialization_format,
        offered_qos_profiles=connection.ext.offered_qos_profiles)
