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

"""What the page works on: the frames, what happened, and the hands that reach the tracker."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from lmsco_ros.console.chronicle import Chronicle
from lmsco_ros.console.feed import Rate
from lmsco_ros.console.frames import Frames
from lmsco_ros.console.picture import Pictures

Answer = Callable[[bool, str], object]
"""Called with whether it was done, and what was said to it, in any thread."""


class Operator(Protocol):
    """What a person can have done; every call returns at once."""

    def start(self, stamp: int, box: tuple[float, float, float, float]) -> None:
        """Follow what is in a box of the frame with a stamp."""

    def point(self, stamp: int, x: float, y: float) -> None:
        """Follow what is at a pixel of the frame with a stamp."""

    def select(self, track_id: int) -> None:
        """Select a target."""

    def reset(self, answer: Answer) -> None:
        """Drop all targets."""

    def enable(self, on: bool, answer: Answer) -> None:
        """Let the tracker go on, or pause."""

    def record(self, on: bool, answer: Answer) -> None:
        """Begin or end a recording."""

    def want_map(self, who: object, wanted: bool) -> None:
        """Have confidence maps as long as somebody wants them."""


class Marker(Operator, Protocol):
    """What a person can have done with a recording besides."""

    def mark_absent(self, stamp: int) -> None:
        """Mark the frame with a stamp as one without the target."""

    def unmark(self, stamp: int) -> None:
        """Take the mark of the frame with a stamp away."""


@dataclass(frozen=True)
class Desk:
    """
    Everything that the connections share.

    Attributes
    ----------
    open_frames : callable
        Returns the frames for one page; called in its event loop.
    chronicle : Chronicle
    pictures : Pictures
    operator : Operator
    images, answers : Rate
        How often images, and statuses of the tracker, come in.
    image_topic : str
        Full name of the topic of the images, or the name of the recording.
    read_only : bool
        Whether pages may only look.
    marker : Marker or None
        The operator, where it has a recording to mark in place of a tracker.
    length : int
        Frames of the recording.
    recorded : callable or None
        Returns how many messages were recorded so far, None while nothing is recorded; where
        pages may record at all.

    """

    open_frames: Callable[[], Frames]
    chronicle: Chronicle
    pictures: Pictures
    operator: Operator
    images: Rate
    answers: Rate
    image_topic: str
    read_only: bool = False
    marker: Marker | None = None
    length: int = 0
    recorded: Callable[[], int | None] | None = None
