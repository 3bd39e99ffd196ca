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

"""Mailboxes between the thread that receives frames and the one that tracks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
import threading
from typing import Generic, TypeVar

T = TypeVar('T')


class Mailbox(ABC, Generic[T]):
    """
    Items in the order in which they came; whoever puts one in never waits.

    The two kinds differ in what happens when frames come faster than they are taken.
    """

    def __init__(self) -> None:
        self._items: deque[T] = deque()
        self._changed = threading.Condition()
        self._closed = False

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: T) -> None:
        """Append an item that a frame must not take the place of."""
        with self._changed:
            self._items.append(item)
            self._changed.notify_all()

    @abstractmethod
    def put_frame(self, frame: T) -> int:
        """Append a frame and return how many frames were dropped for it."""

    def take(self) -> T | None:
        """Wait for the oldest item and remove it; None when the mailbox is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed)
            if self._closed:
                return None
            item, left = self._items.popleft(), len(self._items)
        self._taken(left)
        return item

    @abstractmethod
    def supersede(self, pointless: Callable[[T], bool], replaced: Callable[[T], bool]) -> int:
        """
        Drop waiting items that a new request leaves no use for.

        Parameters
        ----------
        pointless : callable
            Tells such items that answer no frame.
        replaced : callable
            Tells such items that answer a frame, too.

        Returns
        -------
        int
            How many frames will not be answered.

        """

    @abstractmethod
    def has_room(self) -> bool:
        """Tell whether whoever sends may put in another frame."""

    @abstractmethod
    def skips_behind(self, late: Callable[[T], bool]) -> bool:
        """Tell whether a frame put now may be dropped while late items wait before it."""

    def holds(self, kind: Callable[[T], bool]) -> bool:
        """Tell whether such an item waits."""
        with self._changed:
            return any(map(kind, self._items))

    def close(self) -> None:
        """Wake whoever waits, and forget what waits; nothing is handed out from now on."""
        with self._changed:
            self._closed = True
            self._items.clear()
            self._changed.notify_all()

    def _taken(self, left: int) -> None:
        """Act on an item having been removed and so many being left."""


class LatestMailbox(Mailbox[T]):
    """Keeps one frame: a new one takes the place of one that still waits."""

    def __init__(self) -> None:
        super().__init__()
        self._frame: T | None = None

    def put_frame(self, frame: T) -> int:
        """Append a frame; return 1 when an older one had to go."""
        with self._changed:
            before = len(self._items)
            self._items = deque(item for item in self._items if item is not self._frame)
            dropped = before - len(self._items)
            self._frame = frame
            self._items.append(frame)
            self._changed.notify_all()
            return dropped

    def supersede(self, pointless: Callable[[T], bool], replaced: Callable[[T], bool]) -> int:
        """Drop both kinds, so that a flood of requests cannot build up a delay."""
        with self._changed:
            dropped = sum(map(replaced, self._items))
            self._items = deque(item for item in self._items
                                if not pointless(item) and not replaced(item))
            return dropped

    def has_room(self) -> bool:
        """Return True: a new frame always finds a place."""
        return True

    def skips_behind(self, late: Callable[[T], bool]) -> bool:
        """Tell whether late items wait."""
        return self.holds(late)


class BoundedMailbox(Mailbox[T]):
    """
    Keeps every frame; whoever sends has to hold back while `capacity` items are waiting.

    Parameters
    ----------
    capacity : int
        At least 1.
    freed : callable
        Called when there is room again, by the thread that made it.

    """

    def __init__(self, capacity: int, freed: Callable[[], None]) -> None:
        super().__init__()
        self._capacity = capacity
        self._freed = freed

    def put_frame(self, frame: T) -> int:
        """Append a frame; none is ever dropped."""
        self.put(frame)
        return 0

    def supersede(self, pointless: Callable[[T], bool], replaced: Callable[[T], bool]) -> int:
        """Drop what no frame waits behind: what comes out for a frame depends on no haste."""
        with self._changed:
            before = len(self._items)
            while self._items and pointless(self._items[-1]):
                self._items.pop()
            after = len(self._items)
        if after < self._capacity <= before:
            self._freed()
        return 0

    def has_room(self) -> bool:
        """Tell whether less than `capacity` items are waiting."""
        return len(self._items) < self._capacity

    def skips_behind(self, late: Callable[[T], bool]) -> bool:
        """Return False: no frame is ever dropped."""
        return False

    def _taken(self, left: int) -> None:
        if left == self._capacity - 1:
            self._freed()
