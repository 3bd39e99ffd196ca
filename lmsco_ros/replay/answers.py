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

"""What the node said about each frame, put together from its topics."""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from rclpy.serialization import deserialize_message

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.replay.bags.stamps import serialized_stamp
from lmsco_ros.replay.node_session import Heard
from msg_adapters.boxes import box_from_polygon
from msg_adapters.status import FrameStatus, Level, status_from_message

_WITH_BOX = ('tracking', 'uncertain')
_TRACKED = (*_WITH_BOX, 'lost')


@dataclass
class Answer:
    """
    The node's answer to one frame.

    Attributes
    ----------
    status : FrameStatus or None
        None until it arrives.
    box : BoundingBox or None
        None until it arrives, and while the target is lost.
    received : float
        When the box, or without one the status, arrived, on the clock of `time.monotonic`.

    """

    status: FrameStatus | None = None
    box: BoundingBox | None = None
    received: float = 0.0

    @property
    def is_tracked(self) -> bool:
        """Whether the tracker worked on the frame and everything has arrived."""
        if self.status is None or self.status.state not in _TRACKED:
            return False
        return self.box is not None or self.status.state not in _WITH_BOX

    @property
    def failure(self) -> str:
        """Why the node could not do what it was asked for; empty when it could."""
        if self.status is None or self.status.level is not Level.ERROR:
            return ''
        return self.status.message


class Answers:
    """Answers by the stamp of their frame."""

    def __init__(self) -> None:
        self._by_stamp: dict[int, Answer] = {}

    def take(self, heard: Heard) -> Answer:
        """Sort in what was heard and return the answer that it belongs to."""
        answer = self[serialized_stamp(heard.data)]
        if heard.output == 'box':
            polygon = deserialize_message(heard.data, PolygonStamped)
            answer.box = BoundingBox(*box_from_polygon(polygon))
            answer.received = heard.received
        elif heard.output == 'status':
            answer.status = status_from_message(deserialize_message(heard.data, DiagnosticArray))
            answer.received = answer.received or heard.received
        return answer

    def __getitem__(self, stamp: int) -> Answer:
        """Return the answer to the frame with `stamp`, as far as it has arrived."""
        return self._by_stamp.setdefault(stamp, Answer())
