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

"""The rendered scene through the real node, at the pace of a camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import time

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.replay.headers import header_at
from lmsco_ros.replay.node_session import Heard, NodeSession
from lmsco_ros.replay.player import Exchange, Player
from lmsco_ros.synthetic import SceneFrame
from msg_adapters.image import image_from_message, message_from_image

_NO_MAP = np.zeros((1, 1), np.float32)


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """
    A frame that the node answered.

    Attributes
    ----------
    frame : SceneFrame
        Image and truth.
    result : TrackResult
        As it came over the topics.
    latency, tracker_seconds : float
        From sending the image to receiving the box, and the tracker's own share of it.

    """

    frame: SceneFrame
    result: TrackResult
    latency: float
    tracker_seconds: float


def run_scene(frames: Sequence[SceneFrame], parameters: Mapping[str, object],
              on_frame: Callable[[], None]) -> list[TrackedFrame]:
    """
    Publish the frames when they are due, with stamps of the present.

    Parameters
    ----------
    frames : sequence of SceneFrame
        The scene; the node starts on the truth of the first one.
    parameters : mapping
        Of the node.
    on_frame : callable
        Called for each frame that was sent.

    Returns
    -------
    list of TrackedFrame
        Frames that the node dropped, because it was not done with earlier ones, are missing.

    Raises
    ------
    NodeError
        When the node does not start, refuses or stops answering.

    """
    maps: dict[int, _ConfidenceMap] = {}

    def keep_map(heard: Heard, stamp: int, seconds: float) -> None:
        if heard.output == 'confidence_map':
            maps[stamp] = _read_map(heard.data)

    with NodeSession(parameters, outputs=('confidence_map',)) as session:
        player = Player(session, keep_map)
        origin = time.time_ns()

        def send(frame: SceneFrame) -> None:
            stamp = origin + frame.stamp_ns
            player.send(stamp, message_from_image(
                frame.image, header=header_at(stamp, 'thermal_camera')))
            on_frame()

        # The scene stands still until the node has taken up the target.
        player.start(frames[0].box, origin + frames[0].stamp_ns)
        send(frames[0])
        player.settle(allowed=0)
        began = time.monotonic() - frames[0].stamp_ns * 1e-9
        for frame in frames[1:]:
            player.listen_until(began + frame.stamp_ns * 1e-9)
            send(frame)
        player.finish()
    return _assemble(frames, player.exchanges(), maps)


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


def _assemble(frames: Sequence[SceneFrame], exchanges: Sequence[Exchange],
              maps: Mapping[int, _ConfidenceMap]) -> list[TrackedFrame]:
    """Put boxes, states and maps of the answered frames together."""
    tracked, box = [], frames[0].box
    for frame, exchange in zip(frames, exchanges):
        status = exchange.answer.status
        if exchange.latency is None or status is None:
            continue
        box = exchange.answer.box or box
        confidence = maps.get(exchange.stamp, _ConfidenceMap(_NO_MAP, box))
        tracked.append(TrackedFrame(
            frame, TrackResult(box, status.score or 0.0, TrackState(status.state),
                               confidence.values, confidence.region),
            exchange.latency, status.tracker_ms * 1e-3))
    return tracked
