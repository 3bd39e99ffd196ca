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

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult


# What a start is on: the box of a target, or a point (x, y) on it.
Place = BoundingBox | tuple[float, float]


class Tracker(Protocol):
    """The part of the tracker of several targets that the node uses."""

    @property
    def results(self) -> Mapping[int, TrackResult]:
        """What was last said of each target, by its number."""

    def initialize(self, image: npt.NDArray, box: BoundingBox, time: float,
                   in_place_of: Collection[int] = ()) -> int:
        """
        Start on a target in place of others, in a frame that was taken at a time, in seconds.

        Returns its number, never used before.
        """

    def initialize_at(self, image: npt.NDArray, point: tuple[float, float], time: float,
                      in_place_of: Collection[int] = ()) -> int:
        """Start on what is at a point (x, y), whatever its extent; else as `initialize`."""

    def update(self, image: npt.NDArray, time: float,
               only: Collection[int] | None = None) -> Mapping[int, TrackResult]:
        """Find the targets, or only some of them, in their next frame."""

    def learn(self) -> None:
        """Learn from the last frame what the next `update` would begin with."""

    def drop(self, number: int) -> None:
        """Forget a target."""

    def reset(self) -> None:
        """Forget all targets."""


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


@dataclass(frozen=True)
class StartAnswer:
    """
    What became of a wish to start.

    Attributes
    ----------
    number : int
        Of the new target; 0 where the start is refused.
    replaced : tuple of int
        Targets that it has taken the place of.
    reason : str
        Why the start is refused.

    """

    number: int = 0
    replaced: tuple[int, ...] = ()
    reason: str = ''

    @property
    def accepted(self) -> bool:
        """Whether there is a new target."""
        return self.number > 0


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
        TRACKED (there are results), IDLE (no target), DISABLED, REFUSED (a request or a
        frame could not be used; nothing changed) or FAILED (the tracker raised; the targets are
        dropped).
    results : mapping of int to TrackResult
        By the numbers of the targets; empty unless TRACKED.
    track_id : int
        Number of the selected target; of the latest start where there is none, 0 before it.
    live : bool
        False for frames that are gone through again after a start in the past.
    error : str
        Why the request was refused or the targets dropped.
    started, finished : float
        When the work on the frame, its reading included, began and ended, on the clock of
        `time.monotonic`.
    image : ndarray or None
        The pixels of the frame; None when they could not be read, or nobody had to.
    start : StartAnswer or None
        Where somebody had asked to start on this frame.
    dropped : tuple of int
        Targets with a result here that are dropped, since they were lost for too long.

    """

    frame: PendingFrame
    phase: Phase
    results: Mapping[int, TrackResult]
    track_id: int
    live: bool
    error: str
    started: float
    finished: float
    image: npt.NDArray | None = None
    start: StartAnswer | None = None
    dropped: tuple[int, ...] = ()

    @property
    def result(self) -> TrackResult | None:
        """What there is to say of the selected target."""
        return self.results.get(self.track_id)

    @property
    def refused(self) -> bool:
        """Whether a frame or a start could not be used."""
        return self.phase is Phase.REFUSED or (
            self.phase is Phase.TRACKED and self.start is not None and not self.start.accepted)
