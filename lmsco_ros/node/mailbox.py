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
    Items in the order in which they came; commands are never dropped.

    The two kinds differ in what happens when frames come faster than they are taken.
    """

    def __init__(self) -> None:
        self._items: deque[T] = deque()
        self._frames: deque[T] = deque()
        self._changed = threading.Condition()
        self._closed = False

    @abstractmethod
    def put(self, item: T) -> None:
        """Append an item that must not be dropped."""

    @abstractmethod
    def put_frame(self, frame: T) -> int:
        """Append a frame and return how many frames were dropped for it."""

    def take(self) -> T | None:
        """Wait for the oldest item and remove it; None when the mailbox is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed)
            if self._closed:
                return None
            item = self._items.popleft()
            if self._frames and self._frames[0] is item:
                self._frames.popleft()
            self._changed.notify_all()
            return item

    @abstractmethod
    def supersede(self, stale: Callable[[T], bool]) -> None:
        """Drop waiting items, other than frames, that a new command makes pointless."""

    @abstractmethod
    def skips_behind(self, late: Callable[[T], bool]) -> bool:
        """Tell whether a frame put now may be dropped while late items wait before it."""

    def close(self) -> None:
        """Wake everybody who waits; nothing is handed out from now on."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _append(self, item: T, *, is_frame: bool = False) -> None:
        self._items.append(item)
        if is_frame:
            self._frames.append(item)
        self._changed.notify_all()


class LatestMailbox(Mailbox[T]):
    """Keeps one frame: a new one takes the place of one that still waits."""

    def put(self, item: T) -> None:
        """Append an item."""
        with self._changed:
            self._append(item)

    def put_frame(self, frame: T) -> int:
        """Append a frame; return 1 when an older one had to go."""
        with self._changed:
            dropped = len(self._frames)
            if dropped:
                self._items.remove(self._frames.popleft())
            self._append(frame, is_frame=True)
            return dropped

    def supersede(self, stale: Callable[[T], bool]) -> None:
        """Drop the stale items, so that a flood of commands cannot build up a delay."""
        with self._changed:
            self._items = deque(item for item in self._items if not stale(item))

    def skips_behind(self, late: Callable[[T], bool]) -> bool:
        """Tell whether late items wait."""
        with self._changed:
            return any(map(late, self._items))


class BoundedMailbox(Mailbox[T]):
    """
    Keeps everything, and makes the sender wait while `capacity` items are waiting.

    Parameters
    ----------
    capacity : int
        At least 1.

    """

    def __init__(self, capacity: int) -> None:
        super().__init__()
        self._capacity = capacity

    def put(self, item: T) -> None:
        """Append an item as soon as there is room."""
        self._wait_and_append(item, is_frame=False)

    def put_frame(self, frame: T) -> int:
        """Append a frame as soon as there is room; none is ever dropped."""
        self._wait_and_append(frame, is_frame=True)
        return 0

    def supersede(self, stale: Callable[[T], bool]) -> None:
        """Keep them: what comes out must not depend on how fast it is taken."""

    def skips_behind(self, late: Callable[[T], bool]) -> bool:
        """Return False: no frame is ever dropped."""
        return False

    def _wait_and_append(self, item: T, *, is_frame: bool) -> None:
        with self._changed:
            self._changed.wait_for(
                lambda: len(self._items) < self._capacity or self._closed)
            self._append(item, is_frame=is_frame)
