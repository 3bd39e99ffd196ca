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
from typing import Protocol, TypeVar

NANOSECONDS = 1_000_000_000


class Stamped(Protocol):
    """Anything with a time stamp."""

    @property
    def stamp(self) -> int:
        """When it was taken, in nanoseconds."""


F = TypeVar('F', bound=Stamped)


class FrameHistory(deque[F]):
    """
    The newest frames, oldest first.

    Parameters
    ----------
    seconds : float
        Frames older than this, by their stamps, are forgotten; the newest is always kept.
    frames : int
        At most this many are kept.

    """

    def __init__(self, seconds: float, frames: int) -> None:
        super().__init__(maxlen=frames)
        self.seconds = seconds

    def add(self, frame: F) -> None:
        """Append the newest frame; when time went backwards, forget the others."""
        if self and frame.stamp < self[-1].stamp:
            self.clear()
        self.append(frame)
        while self[0].stamp < frame.stamp - self.seconds * NANOSECONDS:
            self.popleft()

    def since(self, stamp: int) -> list[F]:
        """Return the frame with that very stamp and all later ones, or an empty list."""
        frames = list(self)
        stamps = [frame.stamp for frame in frames]
        return frames[stamps.index(stamp):] if stamp in stamps else []
