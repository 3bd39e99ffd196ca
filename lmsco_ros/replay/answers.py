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

from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from rclpy.serialization import deserialize_message

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.replay.bags.stamps import serialized_stamp
from lmsco_ros.replay.node_session import Heard
from msg_adapters.boxes import box_from_polygon
from msg_adapters.status import FrameStatus, Level, statuses_from_message

_WITH_BOX = ('tracking', 'uncertain')
_TRACKED = (*_WITH_BOX, 'lost')


@dataclass
class Answer:
    """
    The node's answer to one frame.

    Attributes
    ----------
    statuses : list of FrameStatus
        One for each target, the selected one first; none until they arrive.
    box : BoundingBox or None
        Of the selected target; None until it arrives, and while the target is lost.
    boxed : set of int
        Numbers of the targets of which a box has arrived.
    started : int
        How many targets were started on the frame.
    received : float
        When the box, or without one the status, arrived, on the clock of `time.monotonic`.

    """

    statuses: list[FrameStatus] = field(default_factory=list)
    box: BoundingBox | None = None
    boxed: set[int] = field(default_factory=set)
    started: int = 0
    received: float = 0.0

    @property
    def status(self) -> FrameStatus | None:
        """Status of the selected target; None until it arrives."""
        return self.statuses[0] if self.statuses else None

    @property
    def is_tracked(self) -> bool:
        """Whether the tracker worked on the frame and everything has arrived."""
        if self.status is None or self.status.state not in _TRACKED:
            return False
        if self.box is None and self.status.state in _WITH_BOX:
            return False
        return self.boxed >= {status.track_id for status in self.statuses
                              if status.state in _WITH_BOX}

    @property
    def failure(self) -> str:
        """Why the node could not do what it was asked for; empty when it could."""
        return next((status.message for status in self.statuses
                     if status.level is Level.ERROR), '')


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
        elif heard.output == 'boxes':
            instance = deserialize_message(heard.data, PolygonInstanceStamped)
            answer.boxed.add(instance.polygon.id)
        elif heard.output == 'status':
            answer.statuses = statuses_from_message(
                deserialize_message(heard.data, DiagnosticArray))
            answer.started += sum(status.start == 'accepted' for status in answer.statuses)
            answer.received = answer.received or heard.received
        return answer

    def __getitem__(self, stamp: int) -> Answer:
        """Return the answer to the frame with `stamp`, as far as it has arrived."""
        return self._by_stamp.setdefault(stamp, Answer())
