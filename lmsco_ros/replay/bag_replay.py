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
from functools import partial
from pathlib import Path
import time

from geometry_msgs.msg import PolygonStamped
from rclpy.serialization import deserialize_message

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.replay.bag_images import (
    choose_topic, COMPRESSED, decode_image, ImageTopic, SkippedImages)
from lmsco_ros.replay.bag_recorder import BagRecorder
from lmsco_ros.replay.bags.channel import Channel
from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.bags.reader import BagReader, open_bag
from lmsco_ros.replay.bags.stamps import ImageStamps, serialized_stamp, with_stamp
from lmsco_ros.replay.bags.uninterrupted import uninterrupted
from lmsco_ros.replay.errors import SourceError
from lmsco_ros.replay.node_session import Heard, NodeSession
from lmsco_ros.replay.player import Exchange, Player
from lmsco_ros.replay.storage import Storage
from msg_adapters.boxes import box_from_polygon

MARKS_TOPIC = '/init_box_stamped'
# While the node tracks one frame, the next one is on its way; the start is waited for.
_AHEAD = 1
_LINGER_SECONDS = 0.3
_LONGEST_PAUSE_SECONDS = 60.0


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
    boxes : tuple of BoundingBox
        Targets in the first image; empty: the boxes that the bag has on `init_box_stamped`.
    topic : str
        Image topic; empty when there is only one.
    rate : float
        Speed relative to the recording; 0 is as fast as the node takes every frame.
    frames : int or None
        Only so many images.
    parameters : mapping
        Of the node.
    outputs : tuple of str
        What to record of the node besides boxes and status.

    """

    bag: Path
    output: Path
    storage: Storage
    boxes: tuple[BoundingBox, ...]
    topic: str
    rate: float
    frames: int | None
    parameters: Mapping[str, object]
    outputs: tuple[str, ...]


class Replay:
    """
    One pass of a bag through the node, recorded beside the original messages.

    When it is broken off, by an error or by a signal, what the node answered so far is kept.

    Parameters
    ----------
    plan : ReplayPlan
        What to play.

    Raises
    ------
    OutputError
        When there is something already where the new bag is wanted.

    """

    def __init__(self, plan: ReplayPlan) -> None:
        self._plan = plan
        self._output = BagOutput(plan.output, plan.storage)
        self._answered = 0

    @property
    def kept(self) -> str:
        """What is in the new bag and where; empty when there is none."""
        if not self._output.is_complete:
            return ''
        return (f'kept in {self._plan.output}: the messages so far, with {self._answered} boxes '
                'of the node')

    def run(self, on_begin: Callable[[int], None],
            on_frame: Callable[[], None]) -> list[Exchange]:
        """
        Play the bag.

        Parameters
        ----------
        on_begin : callable
            Called once with the number of images.
        on_frame : callable
            Called for each image that was sent.

        Returns
        -------
        list of Exchange
            One for each image that could be decoded.

        Raises
        ------
        ReplayError
            When the bag cannot be read or written, or the node refuses.

        """
        plan = self._plan
        with open_bag(plan.bag) as reader:
            if reader.is_ros1:
                raise SourceError(f'{plan.bag} is a bag of ROS 1; convert it with '
                                  f'"rosbags-convert --src {plan.bag} --dst NEW", and replay that')
            images = choose_topic(reader, plan.bag, plan.topic)
            parameters = {'image_reliability': 'reliable', 'max_targets': len(plan.boxes) or 1,
                          **plan.parameters, 'frame_policy': 'latest' if plan.rate else 'all'}
            with NodeSession(parameters, outputs=plan.outputs,
                             compressed=images.msgtype == COMPRESSED) as session, \
                    self._output as output:
                on_begin(min(len(images), plan.frames or len(images)))
                recorder = BagRecorder(output, reader, session.outputs, plan.rate)
                player = Player(session, partial(self._on_heard, recorder))
                _Playback(plan, reader, images, player, recorder).run(on_frame)
        return player.exchanges()

    def _on_heard(self, recorder: BagRecorder, heard: Heard, stamp: int, seconds: float) -> None:
        with uninterrupted():
            recorder.record(heard, stamp, seconds)
            if heard.output == 'box':
                self._answered += 1
                self._output.keep_from_now_on()


class _Playback:
    """
    Sends the images at their pace and copies everything else.

    Parameters
    ----------
    plan : ReplayPlan
        What to play.
    reader : BagReader
        The open bag.
    images : ImageTopic
        What the node is to see.
    player : Player
        Feeds the node.
    recorder : BagRecorder
        Writes the new bag.

    """

    def __init__(self, plan: ReplayPlan, reader: BagReader, images: ImageTopic, player: Player,
                 recorder: BagRecorder) -> None:
        self._plan, self._reader, self._images = plan, reader, images
        self._player, self._recorder = player, recorder
        self._pace = _Pace(plan.rate)
        place = f'on {images.name} of {plan.bag}'
        self._stamps = ImageStamps(place)
        self._skipped = SkippedImages(place)
        self._seen = self._sent = 0

    def run(self, on_frame: Callable[[], None]) -> None:
        """Play until the last wanted image, or the end."""
        plan, player = self._plan, self._player
        for channel, logged, data in self._reader.messages():
            if channel in self._images.channels:
                self._play_image(channel, logged, data)
                on_frame()
                if self._seen == plan.frames:
                    break
            else:
                self._play_other(channel, logged, data)
        self._skipped.finish(self._seen)
        if plan.rate:
            player.finish()
        else:
            player.settle(0)
        # Pictures of the last frame come after its box.
        player.listen_until(time.monotonic() + _LINGER_SECONDS)

    def _play_image(self, channel: Channel, logged: int, data: bytes) -> None:
        """Send an image; one that cannot be decoded is only copied."""
        index, self._seen = self._seen, self._seen + 1
        try:
            header, _ = decode_image(self._reader, data, channel.msgtype)
        except ValueError as error:
            self._skipped.add(index, error)
            self._recorder.copy(channel, logged, data)
            return
        stamp = self._stamps.take(header, logged)
        if stamp != header:
            data = with_stamp(data, stamp)
        if self._plan.rate:
            self._player.listen_until(self._pace.moment(logged))
        else:
            self._player.settle(_AHEAD if self._sent > 1 else 0)
        for box in () if self._sent else self._plan.boxes:
            self._player.start(box, stamp)
        self._recorder.copy_image(channel, logged, data, stamp)
        self._player.send(stamp, data)
        self._sent += 1

    def _play_other(self, channel: Channel, logged: int, data: bytes) -> None:
        if not self._plan.boxes and channel.topic == MARKS_TOPIC:
            self._player.start(_marked(data), serialized_stamp(data))
        self._recorder.copy(channel, logged, data)


def _marked(data: bytes) -> BoundingBox:
    """Return the box of a serialized message that asks for a start."""
    return BoundingBox(*box_from_polygon(deserialize_message(data, PolygonStamped)))


class _Pace:
    """Moments of the present for moments of the recording."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._last: tuple[int, float] | None = None

    def moment(self, logged: int) -> float:
        """Return when to play what was recorded at `logged`, in nanoseconds."""
        now = time.monotonic()
        if self._last is None:
            self._last = (logged, now)
        last, moment = self._last
        # A clock that was set while it was recorded makes pauses of years.
        seconds = min((logged - last) * 1e-9, _LONGEST_PAUSE_SECONDS)
        self._last = (logged, moment + seconds / self._rate)
        return self._last[1]
