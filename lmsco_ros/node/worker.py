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
A tracker in a thread of its own, fed through a mailbox; knows nothing of ROS.

Frames and requests take effect in the order in which they were given, except that a reset
reaches what waits as well. Images are read here, when their turn comes. Everything that
happens to a frame comes back as an :class:`~lmsco_ros.node.outcome.Outcome`, errors included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import threading
import time

import numpy.typing as npt

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.node.history import FrameHistory, NANOSECONDS
from lmsco_ros.node.mailbox import Mailbox
from lmsco_ros.node.outcome import Outcome, PendingFrame, Phase, Tracker
from lmsco_ros.node.work import (answers_no_frame, is_late_step, is_live_start, Item, Orders,
                                 Refuse, Request, Start, Step)


class TrackerWorker:
    """
    Runs a tracker over frames as they come.

    Nobody who hands something over ever waits for the tracker.

    Parameters
    ----------
    tracker : Tracker
        Used by the worker's thread only.
    deliver : callable
        Called with every outcome, in the worker's thread.
    mailbox : Mailbox
        Decides what happens when frames come faster than they are tracked: a
        :class:`~lmsco_ros.node.mailbox.LatestMailbox` drops the older ones, a
        :class:`~lmsco_ros.node.mailbox.BoundedMailbox` says when to hold back.
    history : FrameHistory
        Frames to start on later.
    on_fault : callable
        Called with what was being done and what was raised by it that nobody expects, in the
        worker's thread; must not raise.

    """

    def __init__(self, tracker: Tracker, deliver: Callable[[Outcome], None], *,
                 mailbox: Mailbox[Item], history: FrameHistory[PendingFrame],
                 on_fault: Callable[[str, BaseException], object]) -> None:
        self._tracker = tracker
        self._deliver = deliver
        self._mailbox = mailbox
        self._history = history
        self._on_fault = on_fault
        self._intake = threading.Lock()
        self._orders = Orders()
        self._request: Request | None = None
        self._newest_request: Request | None = None
        self._dropped = 0
        self._extra_steps = self._extra_bytes = 0
        # The rest belongs to the thread alone.
        self._busy_since: float | None = None
        self._track_id = 0
        self._target_of: int | None = None
        self._stopping = threading.Event()
        # A tracker that never returns must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name='tracker', daemon=True)

    @property
    def dropped_frames(self) -> int:
        """Frames that were never tracked because newer ones came."""
        return self._dropped

    @property
    def track_id(self) -> int:
        """Number of the latest start; 0 before the first."""
        return self._track_id

    @property
    def busy_seconds(self) -> float:
        """Time since the work on the present frame began; 0 while the worker waits."""
        since = self._busy_since
        return 0.0 if since is None else time.monotonic() - since

    def has_room(self) -> bool:
        """Tell whether another frame should be handed over now."""
        return self._mailbox.has_room()

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, timeout: float = 1.0) -> bool:
        """
        End the thread after the frame it is at; what waits is discarded.

        Nothing is delivered any more when this returns, even if the tracker did not come
        back in time.

        Parameters
        ----------
        timeout : float
            Seconds to wait for the tracker.

        Returns
        -------
        bool
            Whether the thread ended in time.

        """
        self._stopping.set()
        self._mailbox.close()
        with self._intake:
            # Who refers to whom here goes in circles: it may take long until they are collected.
            self._history.clear()
        if self._thread.ident is not None:
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def submit(self, frame: PendingFrame) -> None:
        """Hand over the next frame."""
        with self._intake:
            self._history.add(frame)
            orders, request = self._orders, self._request
            if request is not None and request.wants(frame):
                self._request = None
                self._mailbox.put(Start(frame, orders, request, live=True))
                return
            if request is not None and request.has_missed(frame, self._history.seconds):
                self._request = None
                self._mailbox.put(
                    Refuse(frame, orders, _unknown_stamp(request.stamp, self._history)))
            if self._may_follow(frame):
                self._mailbox.put(Step(frame, orders, live=False))
            else:
                self._dropped += self._mailbox.put_frame(Step(frame, orders))

    def initialize(self, box: BoundingBox, stamp: int | None = None) -> None:
        """
        Start on a target, in place of any other.

        Parameters
        ----------
        box : BoundingBox
            The target.
        stamp : int, optional
            Stamp of the frame that the box was seen in, in nanoseconds. Frames that came
            since are gone through again, and those that come meanwhile, up to twice as many
            as the history holds; then the newest is next. By default the newest frame is
            taken. A start whose frame is still to come waits for it: without a stamp for the
            first frame that can be read, with one no longer than frames are kept.

        """
        with self._intake:
            self._supersede()
            request = self._newest_request = Request(box, stamp, time.monotonic())
            newest = self._history.last if self._history else None
            if newest is None or stamp is not None and stamp > newest.stamp:
                self._request = request
                return
            frames = [newest] if stamp is None else self._history.since(stamp)
            if not frames:
                self._mailbox.put(
                    Refuse(newest, self._orders, _unknown_stamp(stamp, self._history)))
                return
            self._mailbox.put(Start(frames[0], self._orders, request))
            self._extra_steps, self._extra_bytes = self._history.frames, self._history.nbytes
            for frame in frames[1:]:
                self._mailbox.put(Step(frame, self._orders, live=False))

    def reset(self) -> None:
        """
        Drop the target, and every start that was asked for.

        It takes effect at once: frames that wait are answered without a target.
        """
        with self._intake:
            self._supersede()
            self._orders = replace(self._orders, resets=self._orders.resets + 1)

    def set_enabled(self, enabled: bool) -> None:
        """Pause, keeping the target, or go on."""
        with self._intake:
            self._orders = replace(self._orders, enabled=enabled)

    def _supersede(self) -> None:
        """Forget what earlier starts still have to do."""
        self._request = self._newest_request = None
        self._extra_steps = 0
        self._dropped += self._mailbox.supersede(answers_no_frame, is_live_start)

    def _may_follow(self, frame: PendingFrame) -> bool:
        """Tell whether a start in the past that catches up goes through this frame, too."""
        follows = (self._extra_steps > 0 and self._extra_bytes >= frame.nbytes
                   and self._mailbox.skips_behind(is_late_step))
        if follows:
            self._extra_steps -= 1
            self._extra_bytes -= frame.nbytes
        return follows

    def _run(self) -> None:
        while (item := self._mailbox.take()) is not None:
            self._busy_since = time.monotonic()
            try:
                self._handle(item)
            except BaseException as error:  # noqa: B902
                # Nothing may end the thread: the node would be deaf without a word.
                self._on_fault('answering an image', error)
            self._busy_since = None

    def _handle(self, item: Item) -> None:
        """Read the frame of an item, and do what the item asks for."""
        reset_since = item.orders.resets != self._orders.resets
        if reset_since and not item.live:
            return
        if isinstance(item, Refuse):
            self._report(item, Phase.REFUSED, item.reason)
            return
        started = time.monotonic()
        try:
            image = item.frame.picture.read()
        except LMSCOError as error:
            self._set_aside(item, str(error), started)
        except Exception as error:  # noqa: B902
            self._set_aside(item, f'the image cannot be read: {type(error).__name__}: {error}',
                            started)
        else:
            if isinstance(item, Start) and not reset_since:
                self._begin(item, image, started)
            else:
                self._step(item, image, started)

    def _set_aside(self, item: Step | Start, reason: str, started: float) -> None:
        """Refuse an unreadable frame; a start that any frame would do for waits for another."""
        with self._intake:
            self._history.discard(item.frame)
            if isinstance(item, Start) and item.request.stamp is None \
                    and item.request is self._newest_request:
                self._request = item.request
        self._report(item, Phase.REFUSED, reason, started=started)

    def _step(self, item: Step | Start, image: npt.NDArray, started: float) -> None:
        if not item.orders.enabled:
            self._report(item, Phase.DISABLED, image=image, started=started)
        elif self._target_of != self._orders.resets:
            self._report(item, Phase.IDLE, image=image, started=started)
        else:
            self._track(item, image, lambda: self._tracker.update(image, item.frame.seconds),
                        started)

    def _begin(self, item: Start, image: npt.NDArray, started: float) -> None:
        if not item.orders.enabled:
            self._report(item, Phase.REFUSED, image=image, started=started,
                         error='cannot start while tracking is disabled; enable it first')
            return

        def start() -> TrackResult:
            result = self._tracker.initialize(image, item.request.box, item.frame.seconds)
            self._track_id += 1
            self._target_of = item.orders.resets
            return result

        self._track(item, image, start, started)

    def _track(self, item: Step | Start, image: npt.NDArray,
               work: Callable[[], TrackResult], started: float) -> None:
        """
        Let the tracker work on a frame.

        What the tracker refuses leaves it as it was; anything else that it raises costs the
        target, and only that.
        """
        try:
            result = work()
        except LMSCOError as error:
            self._report(item, Phase.REFUSED, str(error), image=image, started=started)
        except Exception as error:  # noqa: B902
            self._target_of = None
            self._report(item, Phase.FAILED, f'{type(error).__name__}: {error}', image=image,
                         started=started)
        else:
            self._report(item, Phase.TRACKED, image=image, result=result, started=started)

    def _report(self, item: Item, phase: Phase, error: str = '', *,
                result: TrackResult | None = None, image: npt.NDArray | None = None,
                started: float | None = None) -> None:
        if not self._stopping.is_set():
            finished = time.monotonic()
            self._deliver(Outcome(item.frame, phase, result, self._track_id, item.live, error,
                                  finished if started is None else started, finished, image))


def _unknown_stamp(stamp: int | None, history: FrameHistory[PendingFrame]) -> str:
    """Say why a start on a certain frame cannot be met."""
    assert stamp is not None, 'a start without a stamp takes the newest frame'
    first, last = history.first.stamp / NANOSECONDS, history.last.stamp / NANOSECONDS
    return (f'no frame with the stamp {stamp / NANOSECONDS:.9f} is kept (there are '
            f'{len(history)} from {first:.9f} to {last:.9f}); copy the stamp of the image that '
            'the box was found in, or keep frames for longer')
