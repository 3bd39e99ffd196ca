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

"""What goes into the worker and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult


class Tracker(Protocol):
    """The part of the tracker that the node uses."""

    def initialize(self, image: npt.NDArray, box: BoundingBox, time: float) -> TrackResult:
        """Start on a target in a frame that was taken at a time, in seconds."""

    def update(self, image: npt.NDArray, time: float) -> TrackResult:
        """Find the target in the next frame."""


class Picture(Protocol):
    """
    An image as it was received: small where it is compressed, read as often as it is needed.

    Its memory is written by nobody else from its making on.
    """

    @property
    def nbytes(self) -> int:
        """Memory that it takes while it waits, in bytes."""

    def read(self) -> npt.NDArray:
        """
        Return the pixels, shape (H, W) or (H, W, 3).

        Raises
        ------
        LMSCOError
            When they cannot be read.

        """


@dataclass(frozen=True, eq=False)
class PendingFrame:
    """
    One image on its way to the tracker.

    Attributes
    ----------
    picture : Picture
        What was received; read when the tracker gets to it, never when it is dropped.
    stamp : int
        When it was taken, in nanoseconds.
    received : float
        When it arrived, on the clock of `time.monotonic`.
    context : Any
        Whatever the sender wants to get back with the outcome.

    """

    picture: Picture
    stamp: int
    received: float
    context: Any = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes while it waits, in bytes."""
        return self.picture.nbytes

    @property
    def seconds(self) -> float:
        """When it was taken, in seconds."""
        return 1e-9 * self.stamp


class Phase(Enum):
    """What became of a frame."""

    TRACKED = 'tracked'
    IDLE = 'idle'
    DISABLED = 'disabled'
    REFUSED = 'refused'
    FAILED = 'failed'


@dataclass(frozen=True, eq=False)
class Outcome:
    """
    What the tracker has to say about one frame.

    Attributes
    ----------
    frame : PendingFrame
    phase : Phase
        TRACKED (there is a result), IDLE (no target), DISABLED, REFUSED (a request or a
        frame could not be used; nothing changed) or FAILED (the tracker raised; the target is
        dropped).
    result : TrackResult or None
        Only when TRACKED.
    track_id : int
        Number of the start that the result belongs to; 0 before the first.
    live : bool
        False for frames that are gone through again after a start in the past.
    error : str
        Why the request was refused or the target dropped.
    started, finished : float
        When the work on the frame, its reading included, began and ended, on the clock of
        `time.monotonic`.
    image : ndarray or None
        The pixels of the frame; None when they could not be read, or nobody had to.

    """

    frame: PendingFrame
    phase: Phase
    result: TrackResult | None
    track_id: int
    live: bool
    error: str
    started: float
    finished: float
    image: npt.NDArray | None = None
