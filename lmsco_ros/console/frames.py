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

"""Where the frames that a page asks for come from while a camera runs."""

from __future__ import annotations

import asyncio
from typing import Protocol

from lmsco_ros.console.feed import Feed
from lmsco_ros.console.moments import Moment

_SILENCE_SECONDS = 1.0


class Frames(Protocol):
    """The frames for one page; used in its event loop."""

    async def after(self, number: int) -> Moment | None:
        """Return the frame to show after that of a number; None when none comes in a while."""

    async def beside(self, number: int, steps: int) -> Moment | None:
        """Return the frame some steps from that of a number; None when there is none at all."""

    def close(self) -> None:
        """Give up what is needed to wait for frames."""


class LiveFrames:
    """
    The newest frame of a camera, and those of the last seconds.

    Parameters
    ----------
    feed : Feed
        Filled in another thread.

    """

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._loop = asyncio.get_running_loop()
        self._news = asyncio.Event()
        self._unwatch = feed.watch(self._wake)

    async def after(self, number: int) -> Moment | None:
        """Return the newest frame as soon as it is newer; None when none comes for a second."""
        deadline = self._loop.time() + _SILENCE_SECONDS
        while True:
            self._news.clear()
            moment = self._feed.after(number)
            if moment is not None:
                return moment
            try:
                await asyncio.wait_for(self._news.wait(), deadline - self._loop.time())
            except asyncio.TimeoutError:
                return None

    async def beside(self, number: int, steps: int) -> Moment | None:
        """Return the frame some steps from that of a number, as far as they are kept."""
        return self._feed.beside(number, steps)

    def close(self) -> None:
        """Wait for frames no longer."""
        self._unwatch()

    def _wake(self) -> None:
        """Be told, in another thread, that there is a new frame."""
        try:
            self._loop.call_soon_threadsafe(self._news.set)
        except RuntimeError:
            # The server has ended in the meantime.
            pass
