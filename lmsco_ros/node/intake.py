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

"""
What is heard, put in order: frames and wishes become items in the mailbox of the worker.

Frames and requests take effect in the order in which they were given, except that a reset
reaches what waits as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
import threading
import time

from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.node.history import FrameHistory, NANOSECONDS
from lmsco_ros.node.mailbox import Mailbox
from lmsco_ros.node.outcome import PendingFrame, Place
from lmsco_ros.node.work import is_late_step, Item, Orders, Refuse, Request, Start, Step


class Intake:
    """
    Takes frames and wishes to start; nobody who hands something over ever waits.

    Parameters
    ----------
    mailbox : Mailbox
        Decides what happens when frames come faster than they are tracked: a
        :class:`~lmsco_ros.node.mailbox.LatestMailbox` drops the older ones, a
        :class:`~lmsco_ros.node.mailbox.BoundedMailbox` says when to hold back.
    history : FrameHistory
        Frames to start on later.
    most_targets : int
        So many starts may wait: those that came before are superseded.

    """

    def __init__(self, mailbox: Mailbox[Item], history: FrameHistory[PendingFrame],
                 most_targets: int) -> None:
        self._mailbox = mailbox
        self._history = history
        self._most_starts = most_targets
        self._intake = threading.Lock()
        self._orders = Orders()
        # The newest wishes, and those among them that wait for a frame.
        self._wishes: list[Request] = []
        self._waiting: list[Request] = []
        self._dropped = 0
        self._extra_steps = self._extra_bytes = 0

    @property
    def dropped_frames(self) -> int:
        """Frames that were never tracked because newer ones came."""
        return self._dropped

    def has_room(self) -> bool:
        """Tell whether another frame should be handed over now."""
        return self._mailbox.has_room()

    def submit(self, frame: PendingFrame) -> None:
        """Hand over the next frame."""
        with self._intake:
            self._history.add(frame)
            live = True
            for request in self._waiting[:]:
                if request.wants(frame):
                    self._waiting.remove(request)
                    self._mailbox.put(Start(frame, self._orders, request, live=live))
                    live = False
                elif request.has_missed(frame, self._history.seconds):
                    self._waiting.remove(request)
                    self._refuse(request, frame)
            if not live:
                return
            if self._may_follow(frame):
                self._mailbox.put(Step(frame, self._orders, live=False))
            else:
                self._dropped += self._mailbox.put_frame(Step(frame, self._orders))

    def offer(self, box: BoundingBox, stamp: int | None,
              is_wanted: Callable[[Mapping[int, TrackResult]], bool]) -> None:
        """
        Start on what a machine has found, unless another start waits or it is not wanted.

        While disabled nothing is taken up.

        Parameters
        ----------
        box, stamp
            As for :meth:`initialize`.
        is_wanted : callable
            Tells from what was last said of each target whether to start; asked in the thread
            that tracks.

        """
        with self._intake:
            if self._orders.enabled and not self._waiting \
                    and not self._mailbox.holds(_is_start):
                self._take_up(Request(box, stamp, time.monotonic(), is_wanted))

    def keeps(self, stamp: int) -> bool:
        """Tell whether there is a frame with that very stamp to start on."""
        with self._intake:
            return bool(self._history.since(stamp))

    def initialize(self, place: Place, stamp: int | None = None) -> None:
        """
        Start on a target, in place of another one where there may be no more.

        Parameters
        ----------
        place : BoundingBox, or tuple of float
            The target, or a point on it.
        stamp : int, optional
            Stamp of the frame that it was seen in, in nanoseconds. Frames that came
            since are gone through again, and those that come meanwhile, up to twice as many
            as the history holds; then the newest is next. By default the newest frame is
            taken. A start whose frame is still to come waits for it: without a stamp for the
            first frame that can be read, with one no longer than frames are kept.

        """
        with self._intake:
            self._take_up(Request(place, stamp, time.monotonic()))

    def reset(self) -> None:
        """
        Drop all targets, and every start that was asked for.

        It takes effect at once: frames that wait are answered without a target.
        """
        with self._intake:
            self._supersede(0)
            self._orders = replace(self._orders, resets=self._orders.resets + 1)

    def set_enabled(self, enabled: bool) -> None:
        """Pause, keeping the targets, or go on."""
        with self._intake:
            self._orders = replace(self._orders, enabled=enabled)

    def _supersede(self, kept: int) -> None:
        """Forget what all wishes but so many of the newest still have to do."""
        self._wishes = self._wishes[-kept:] if kept else []
        self._waiting = [request for request in self._waiting if request in self._wishes]
        self._extra_steps = 0

        def outdated(item: Item) -> bool:
            return not kept if item.request is None else item.request not in self._wishes

        self._dropped += self._mailbox.supersede(
            lambda item: not item.live and outdated(item),
            lambda item: item.live and isinstance(item, Start) and outdated(item))

    def _take_up(self, request: Request) -> None:
        """Put a wish at its place in time; holds the lock, as all of these."""
        self._supersede(self._most_starts - 1)
        self._wishes.append(request)
        stamp, newest = request.stamp, self._history.last if self._history else None
        if newest is None or stamp is not None and stamp > newest.stamp:
            self._waiting.append(request)
            return
        frames = [newest] if stamp is None else self._history.since(stamp)
        if not frames:
            self._refuse(request, newest)
            return
        self._mailbox.put(Start(frames[0], self._orders, request))
        self._extra_steps, self._extra_bytes = self._history.frames, self._history.nbytes
        for frame in frames[1:]:
            self._mailbox.put(Step(frame, self._orders, live=False, request=request))

    def _wait_again(self, request: Request) -> None:
        """Let a wish wait for another frame, unless it is superseded."""
        if request in self._wishes:
            self._waiting.append(request)

    def _refuse(self, request: Request, frame: PendingFrame) -> None:
        """Refuse a wish of which the frame is not kept."""
        reason = _unknown_stamp(request.stamp, self._history)
        self._mailbox.put(Refuse(frame, self._orders, reason, request))

    def _may_follow(self, frame: PendingFrame) -> bool:
        """Tell whether a start in the past that catches up goes through this frame, too."""
        follows = (self._extra_steps > 0 and self._extra_bytes >= frame.nbytes
                   and self._mailbox.skips_behind(is_late_step))
        if follows:
            self._extra_steps -= 1
            self._extra_bytes -= frame.nbytes
        return follows


def _is_start(item: Item) -> bool:
    return isinstance(item, Start)


def _unknown_stamp(stamp: int | None, history: FrameHistory[PendingFrame]) -> str:
    """Say why a start on a certain frame cannot be met."""
    assert stamp is not None, 'a start without a stamp takes the newest frame'
    wanted, first, last = (each / NANOSECONDS for each in (
        stamp, history.first.stamp, history.last.stamp))
    kept = f'{len(history)} from {first:.9f} to {last:.9f}'
    if wanted < first:
        return (f'no frame with the stamp {wanted:.9f} is kept: it is {first - wanted:.1f} s too '
                f'old (there are {kept}); start on a newer one, or keep frames for longer '
                '(frame_history_seconds)')
    return (f'no frame with the stamp {wanted:.9f} is kept (there are {kept}); copy the stamp of '
            'the image that the box was found in')
