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

"""Stamps from the times of a container, whatever these are worth."""

from __future__ import annotations

from fractions import Fraction
from math import floor

# Times that are in disorder are so by a few frames.
_RESTART_PERIODS = 5


class Timeline:
    """
    The times of frames, from the first one on, always going forward.

    A frame without a time comes one period after the frame before it, and so does one whose
    time is far before that: there the container starts to count again, as where films were
    joined. A frame whose time is just not later comes a nanosecond after the frame before it,
    so that no two frames share a stamp.

    Parameters
    ----------
    fps : Fraction
        Frames per second where times are missing.

    Attributes
    ----------
    missing, repeated, restarts : int
        How many frames had no time, had one that was not later, and began to count again.

    """

    def __init__(self, fps: Fraction) -> None:
        self._period = 1_000_000_000 / fps
        self._origin: Fraction | None = None
        self._last: Fraction | None = None
        self.missing = 0
        self.repeated = 0
        self.restarts = 0

    def stamp(self, seconds: Fraction | None) -> int:
        """
        Return the stamp of the next frame, in nanoseconds from the first one.

        Parameters
        ----------
        seconds : Fraction, optional
            Its time in the container.

        """
        time = self._since_first(seconds)
        if self._last is not None and time < self._last + 1:
            time = self._later(time, self._last)
        self._last = time
        # Halves all go one way: what is a nanosecond apart stays so.
        return floor(time + Fraction(1, 2))

    def _later(self, time: Fraction, last: Fraction) -> Fraction:
        """Return a time behind `last` for a frame that claims another."""
        if self._origin is None or last - time < _RESTART_PERIODS * self._period:
            self.repeated += 1
            return last + 1
        self.restarts += 1
        self._origin -= last + self._period - time
        return last + self._period

    def _since_first(self, seconds: Fraction | None) -> Fraction:
        if seconds is None:
            self.missing += 1
            return Fraction(0) if self._last is None else self._last + self._period
        time = seconds * 1_000_000_000
        if self._origin is None:
            self._origin = time if self._last is None else time - self._last - self._period
        return time - self._origin
