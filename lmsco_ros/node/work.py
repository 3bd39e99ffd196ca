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

"""What waits in the mailbox of the worker: frames, and what was asked for with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from lmsco_ros.core.types import TrackResult
from lmsco_ros.node.outcome import PendingFrame, Place


@dataclass(frozen=True)
class Orders:
    """What users had asked for when an item was put in; it holds for the item."""

    enabled: bool = True
    resets: int = 0


def _always(results: Mapping[int, TrackResult]) -> bool:
    """Tell that a start is wanted, whatever is followed."""
    return True


@dataclass(frozen=True, eq=False)
class Request:
    """
    A wish to start; without a stamp any frame will do.

    One of a machine is met only while it is wanted, and is no matter otherwise.
    """

    place: Place
    stamp: int | None
    made: float
    is_wanted: Callable[[Mapping[int, TrackResult]], bool] = _always

    def wants(self, frame: PendingFrame) -> bool:
        """Tell whether the frame is the one to start on."""
        return self.stamp is None or frame.stamp == self.stamp

    def has_missed(self, frame: PendingFrame, patience: float) -> bool:
        """Tell from a later frame whether the one to start on will not come any more."""
        return self.stamp is not None and (
            frame.stamp > self.stamp or frame.received - self.made > patience)


@dataclass(frozen=True, eq=False)
class Step:
    """
    A frame to follow the targets in; not live when it is gone through late.

    One that only a target started in the past goes through, since the others have seen it, names
    the wish to start on that target.
    """

    frame: PendingFrame
    orders: Orders
    live: bool = True
    request: Request | None = None


@dataclass(frozen=True, eq=False)
class Start:
    """A frame to start on; live when it has just come and is answered by that."""

    frame: PendingFrame
    orders: Orders
    request: Request
    live: bool = False


@dataclass(frozen=True, eq=False)
class Refuse:
    """A request that cannot be met, told with the frame that showed it."""

    frame: PendingFrame
    orders: Orders
    reason: str
    request: Request
    live: bool = False


Item = Step | Start | Refuse


def is_late_step(item: Item) -> bool:
    """Tell whether an item belongs to a start in the past that catches up."""
    return isinstance(item, Step) and not item.live
