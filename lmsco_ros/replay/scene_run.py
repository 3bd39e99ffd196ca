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

"""A scene or a clip through the real node, at the pace of a camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
import time

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.replay.frame import RecordedFrame
from lmsco_ros.replay.headers import header_at
from lmsco_ros.replay.node_session import Heard, NodeSession
from lmsco_ros.replay.player import Player
from msg_adapters.image import image_from_message, message_from_image

_NO_MAP = np.zeros((1, 1), np.float32)


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """
    A frame that the node answered.

    Attributes
    ----------
    frame : RecordedFrame
        As it was sent.
    result : TrackResult
        As it came over the topics.
    latency, tracker_seconds : float
        From sending the image to receiving the box, and the tracker's own share of it.

    """

    frame: RecordedFrame
    result: TrackResult
    latency: float
    tracker_seconds: float


class SceneRun:
    """
    One pass of the scene through the node; what was answered outlives an interruption.

    Parameters
    ----------
    frames : sequence of RecordedFrame
        What the camera sees; stamps count from the first one.
    start : BoundingBox
        The target in the first frame.
    on_sent : callable
        Called for each frame that was sent.
    on_answer : callable
        Called with each frame soon after it was answered, in the order sent; the confidence
        map may be missing still.

    """

    def __init__(self, frames: Sequence[RecordedFrame], start: BoundingBox, *,
                 on_sent: Callable[[], None] = lambda: None,
                 on_answer: Callable[[TrackedFrame], None] = lambda frame: None) -> None:
        self._frames = frames
        self._on_sent = on_sent
        self._on_answer = on_answer
        self._maps: dict[int, _ConfidenceMap] = {}
        self._player: Player | None = None
        self._next, self._start, self._box = 0, start, start

    def play(self, parameters: Mapping[str, object]) -> None:
        """
        Publish the frames when they are due, with stamps of the present.

        Parameters
        ----------
        parameters : mapping
            Of the node.

        Raises
        ------
        NodeError
            When the node does not start, refuses or stops answering.

        """
        first = self._frames[0]
        with NodeSession(parameters, outputs=('confidence_map',)) as session:
            self._player = player = Player(session, self._keep_map)
            origin = time.time_ns()
            try:
                # The scene stands still until the node has taken up the target.
                player.start(self._start, origin + first.stamp_ns)
                self._send(player, first, origin)
                player.settle(allowed=0)
                began = time.monotonic() - first.stamp_ns * 1e-9
                for frame in self._frames[1:]:
                    player.listen_until(began + frame.stamp_ns * 1e-9)
                    self._tell()
                    self._send(player, frame, origin)
                player.finish()
            finally:
                self._tell()

    def tracked(self) -> list[TrackedFrame]:
        """
        Return what was answered so far.

        Frames that the node dropped, because it was not done with earlier ones, are missing.
        """
        return [item for _, item in self._answered(0, self._start)]

    def _send(self, player: Player, frame: RecordedFrame, origin: int) -> None:
        stamp = origin + frame.stamp_ns
        player.send(stamp, message_from_image(
            frame.image, header=header_at(stamp, 'thermal_camera')))
        self._on_sent()

    def _keep_map(self, heard: Heard, stamp: int, seconds: float) -> None:
        if heard.output == 'confidence_map':
            self._maps[stamp] = _read_map(heard.data)

    def _tell(self) -> None:
        """Hand on the answers that have come since the last call."""
        for index, item in self._answered(self._next, self._box):
            self._next, self._box = index + 1, item.result.box
            self._on_answer(item)

    def _answered(self, start: int, box: BoundingBox) -> Iterator[tuple[int, TrackedFrame]]:
        """Yield answered frames with their numbers from `start` on; `box` is the one before."""
        exchanges = [] if self._player is None else self._player.exchanges(start)
        for index, exchange in enumerate(exchanges, start):
            status = exchange.answer.status
            if exchange.latency is None or status is None:
                continue
            box = exchange.answer.box or box
            confidence = self._maps.get(exchange.stamp, _ConfidenceMap(_NO_MAP, box))
            result = TrackResult(box, status.score or 0.0, TrackState(status.state),
                                 confidence.values, confidence.region)
            yield index, TrackedFrame(self._frames[index], result, exchange.latency,
                                      status.tracker_ms * 1e-3)


@dataclass(frozen=True, eq=False)
class _ConfidenceMap:
    values: npt.NDArray[np.float32]
    region: BoundingBox


def _read_map(data: bytes) -> _ConfidenceMap:
    """Return the part of a confidence image that the search region covers."""
    image = image_from_message(deserialize_message(data, Image))
    rows, columns = np.flatnonzero(image.any(1)), np.flatnonzero(image.any(0))
    if not rows.size:
        return _ConfidenceMap(_NO_MAP, BoundingBox(0, 0, image.shape[1], image.shape[0]))
    top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
    return _ConfidenceMap(image[top:bottom, left:right].copy(),
                          BoundingBox(left, top, right - left, bottom - top))
