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

"""The frames of the last seconds, from the thread of ROS to those who show them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import itertools
import threading
import time

from lmsco_ros.console.moments import Moment

_MOST_MOMENTS = 300
_RATE_SECONDS = 2.0


class Feed:
    """
    Keeps frames and tells whoever waits that there is a new one; safe in every thread.

    Parameters
    ----------
    megabytes : float
        Of images that are kept for stepping back.

    """

    def __init__(self, megabytes: float = 64.0) -> None:
        self._lock = threading.Lock()
        self._most_bytes = megabytes * 1e6
        self._moments: deque[Moment] = deque(maxlen=_MOST_MOMENTS)
        self._bytes = 0
        self._watchers: dict[int, Callable[[], object]] = {}
        self._keys = itertools.count()

    def add(self, moment: Moment) -> None:
        """Keep a frame, and tell those who watch."""
        with self._lock:
            if len(self._moments) == _MOST_MOMENTS:
                self._forget()
            self._moments.append(moment)
            self._bytes += moment.image.nbytes
            while self._bytes > self._most_bytes and len(self._moments) > 1:
                self._forget()
            watchers = list(self._watchers.values())
        for tell in watchers:
            tell()

    def after(self, number: int) -> Moment | None:
        """Return the newest frame if it is newer than `number`."""
        with self._lock:
            newest = self._moments[-1] if self._moments else None
        return newest if newest is not None and newest.number > number else None

    def beside(self, number: int, steps: int) -> Moment | None:
        """Return the frame `steps` after that of `number`, or the last one in that direction."""
        with self._lock:
            if not self._moments:
                return None
            numbers = [moment.number for moment in self._moments]
            place = next((index for index, each in enumerate(numbers) if each >= number),
                         len(numbers) - 1)
            return self._moments[min(max(place + steps, 0), len(numbers) - 1)]

    def watch(self, tell: Callable[[], object]) -> Callable[[], None]:
        """Have `tell` called, in the thread of whoever adds; return how to end that."""
        with self._lock:
            key = next(self._keys)
            self._watchers[key] = tell

        def end() -> None:
            with self._lock:
                self._watchers.pop(key, None)
        return end

    def _forget(self) -> None:
        self._bytes -= self._moments.popleft().image.nbytes


class Rate:
    """How often something happened in the last seconds; safe in every thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._times: deque[float] = deque(maxlen=2000)
        self.last: float | None = None

    def count(self) -> None:
        """Note that it happened."""
        self.last = self._clock()
        self._times.append(self.last)

    @property
    def per_second(self) -> float:
        """Mean over the last two seconds."""
        since = self._clock() - _RATE_SECONDS
        return sum(moment >= since for moment in tuple(self._times)) / _RATE_SECONDS

    @property
    def silence(self) -> float | None:
        """Seconds since it happened last; None when it never did."""
        return None if self.last is None else self._clock() - self.last
