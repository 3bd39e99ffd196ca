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

"""What belongs to one frame, gathered from several topics by its stamp."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import time

import numpy.typing as npt

from msg_adapters.boxes import Box
from msg_adapters.state import State
from msg_adapters.status import FrameStatus

FOUND = ('tracking', 'uncertain')
# Longer than a slow tracker takes for a frame: until then, pictures wait for what it says.
_SILENCE_SECONDS = 2.0
# A state or a map that nobody publishes must not hold the picture up.
_EXTRA_SECONDS = 0.25
_MOST_WAITING = 64
_MOST_BYTES = 128 * 2 ** 20


@dataclass(frozen=True)
class Moment:
    """
    A frame with all that was said about it.

    Attributes
    ----------
    number : int
        Grows with every image that came in.
    stamp : int
        Of the image, in nanoseconds.
    received : float
        When the image came in, on the clock of `time.monotonic`.
    image : ndarray, shape (H, W) or (H, W, 3)
        As the camera sent it.
    statuses : tuple of FrameStatus
        Of every target, the selected one first; empty when the tracker said nothing.
    boxes : mapping of int to Box
        By the number of the target, in pixels.
    states : mapping of int to State
        Where targets are expected and how they move, by their numbers; of lost ones, too.
    confidence : ndarray, shape (H, W), float32, or None
        Confidence map of the selected target.

    """

    number: int
    stamp: int
    received: float
    image: npt.NDArray
    statuses: tuple[FrameStatus, ...] = ()
    boxes: Mapping[int, Box] = field(default_factory=dict)
    states: Mapping[int, State] = field(default_factory=dict)
    confidence: npt.NDArray | None = None


@dataclass
class _Parts:
    """What has come so far."""

    number: int = 0
    received: float = 0.0
    image: npt.NDArray | None = None
    statuses: tuple[FrameStatus, ...] = ()
    boxes: dict[int, Box] = field(default_factory=dict)
    states: dict[int, State] = field(default_factory=dict)
    confidence: npt.NDArray | None = None

    @property
    def is_told(self) -> bool:
        """Whether the tracker has said all but the states and the confidence map."""
        return bool(self.statuses) and all(
            status.track_id in self.boxes for status in self.statuses
            if status.state in FOUND)

    def is_complete(self, with_states: bool, with_map: bool) -> bool:
        """Whether nothing is missing any more."""
        missing_state = with_states and any(
            status.track_id not in self.states for status in self.statuses
            if status.state in (*FOUND, 'lost'))
        missing_map = (with_map and self.confidence is None and bool(self.statuses)
                       and self.statuses[0].state in (*FOUND, 'lost'))
        return self.is_told and not missing_state and not missing_map


class Assembly:
    """
    Gathers frames, and hands each on when it is complete, never one that is older.

    While the tracker speaks, a frame waits for what it says; frames that it skipped are left
    out. When it has been silent for two seconds, images are handed on as they come. All calls
    come from one thread.

    Parameters
    ----------
    deliver : callable
        Gets the :class:`Moment`.
    clock : callable
        Returns seconds that never go back.

    Attributes
    ----------
    with_map : bool
        Whether a frame with a target waits for its confidence map.

    """

    def __init__(self, deliver: Callable[[Moment], object],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self.with_map = False
        self._deliver = deliver
        self._clock = clock
        self._waiting: dict[int, _Parts] = {}
        self._images = 0
        self._heard = clock()
        self._with_states = False

    def add_image(self, stamp: int, image: npt.NDArray) -> None:
        """Take the image with a stamp."""
        # A stamp that comes again, as when a recording starts over, begins anew.
        if stamp in self._waiting and self._waiting[stamp].image is not None:
            del self._waiting[stamp]
        parts = self._parts(stamp)
        self._images += 1
        parts.number, parts.received, parts.image = self._images, self._clock(), image
        self.release()

    def add_statuses(self, stamp: int, statuses: tuple[FrameStatus, ...]) -> None:
        """Take what is said of every target in the frame with a stamp."""
        self._heard = self._clock()
        self._parts(stamp).statuses = statuses
        self.release()

    def add_box(self, stamp: int, track_id: int, box: Box) -> None:
        """Take the box of a target in the frame with a stamp."""
        self._parts(stamp).boxes[track_id] = box
        self.release()

    def add_state(self, stamp: int, state: State) -> None:
        """Take the state of a target in the frame with a stamp; from now on they are awaited."""
        self._with_states = True
        self._parts(stamp).states[state.track_id] = state
        self.release()

    def add_confidence(self, stamp: int, confidence: npt.NDArray) -> None:
        """Take the confidence map of the frame with a stamp."""
        self._parts(stamp).confidence = confidence
        self.release()

    def release(self) -> None:
        """Hand on the newest frame that need not wait any longer; to be called now and then."""
        self._limit()
        now = self._clock()
        is_silent = now - self._heard >= _SILENCE_SECONDS
        ready = [(parts.number, stamp) for stamp, parts in self._waiting.items()
                 if parts.image is not None
                 and (is_silent or parts.is_complete(self._with_states, self.with_map)
                      or parts.is_told and now - parts.received >= _EXTRA_SECONDS)]
        if not ready:
            return
        number, stamp = max(ready)
        parts = self._waiting[stamp]
        self._waiting = {other: later for other, later in self._waiting.items()
                         if later.image is None or later.number > number}
        assert parts.image is not None, 'only those with an image are ready'
        self._deliver(Moment(number, stamp, parts.received, parts.image, parts.statuses,
                             dict(parts.boxes), dict(parts.states), parts.confidence))

    def _parts(self, stamp: int) -> _Parts:
        return self._waiting.setdefault(stamp, _Parts())

    def _limit(self) -> None:
        """Forget the oldest of what will hardly become complete."""
        while len(self._waiting) > 1 and (
                len(self._waiting) > _MOST_WAITING or self._bytes() > _MOST_BYTES):
            del self._waiting[next(iter(self._waiting))]

    def _bytes(self) -> int:
        return sum(parts.image.nbytes for parts in self._waiting.values()
                   if parts.image is not None)
