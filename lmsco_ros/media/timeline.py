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


class Timeline:
    """
    The times of frames, from the first one on, always going forward.

    A frame without a time comes one period after the frame before it. A frame whose time is
    not later than that of the frame before it comes a nanosecond after it, so that no two
    frames share a stamp.

    Parameters
    ----------
    fps : Fraction
        Frames per second where times are missing.

    Attributes
    ----------
    missing, repeated : int
        How many frames had no time, and a time that was not later.

    """

    def __init__(self, fps: Fraction) -> None:
        self._period = 1_000_000_000 / fps
        self._origin: Fraction | None = None
        self._last: Fraction | None = None
        self.missing = 0
        self.repeated = 0

    def stamp(self, seconds: Fraction | None) -> int:
        """
        Return the stamp of the next frame, in nanoseconds from the first one.

        Parameters
        ----------
        seconds : Fraction, optional
            Its time in the container.

        """
        time = self._since_first(seconds)
        if self._last is not None and time <= self._last:
            self.repeated += 1
            time = self._last + 1
        self._last = time
        return round(time)

    def _since_first(self, seconds: Fraction | None) -> Fraction:
        if seconds is None:
            self.missing += 1
            return Fraction(0) if self._last is None else self._last + self._period
        time = seconds * 1_000_000_000
        if self._origin is None:
            self._origin = time if self._last is None else time - self._last - self._period
        return time - self._origin
