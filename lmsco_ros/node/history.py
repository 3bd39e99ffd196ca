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

"""Frames of the last moments, found again by their stamp."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Generic, Protocol, TypeVar

NANOSECONDS = 1_000_000_000


class Stamped(Protocol):
    """Anything with a time stamp that takes memory."""

    @property
    def stamp(self) -> int:
        """When it was taken, in nanoseconds."""

    @property
    def nbytes(self) -> int:
        """Memory that it takes, in bytes."""


F = TypeVar('F', bound=Stamped)


class FrameHistory(Generic[F]):
    """
    The newest frames, oldest first; the newest itself is always kept.

    Parameters
    ----------
    seconds : float
        Frames older than this, by their stamps, are forgotten.
    frames : int
        At most this many are kept.
    nbytes : int
        At most so much memory is kept.

    """

    def __init__(self, seconds: float, frames: int, nbytes: int) -> None:
        self.seconds = seconds
        self.frames = frames
        self.nbytes = nbytes
        self._kept: deque[F] = deque()
        self._taken = 0

    def __len__(self) -> int:
        return len(self._kept)

    def __iter__(self) -> Iterator[F]:
        return iter(self._kept)

    @property
    def first(self) -> F:
        """The oldest frame; IndexError when there is none."""
        return self._kept[0]

    @property
    def last(self) -> F:
        """The newest frame; IndexError when there is none."""
        return self._kept[-1]

    def add(self, frame: F) -> None:
        """Append the newest frame; when time went backwards, forget the others."""
        if self._kept and frame.stamp < self.last.stamp:
            self.clear()
        self._kept.append(frame)
        self._taken += frame.nbytes
        while len(self._kept) > 1 and self._is_too_much():
            self._taken -= self._kept.popleft().nbytes

    def discard(self, frame: F) -> None:
        """Forget a frame, if it is still kept."""
        if frame in self._kept:
            self._kept.remove(frame)
            self._taken -= frame.nbytes

    def clear(self) -> None:
        """Forget all frames."""
        self._kept.clear()
        self._taken = 0

    def since(self, stamp: int) -> list[F]:
        """Return the frame with that very stamp and all later ones, or an empty list."""
        frames = list(self._kept)
        stamps = [frame.stamp for frame in frames]
        return frames[stamps.index(stamp):] if stamp in stamps else []

    def _is_too_much(self) -> bool:
        return (len(self._kept) > self.frames or self._taken > self.nbytes
                or self.first.stamp < self.last.stamp - self.seconds * NANOSECONDS)
