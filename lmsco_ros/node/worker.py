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

Frames and commands take effect in the order in which they were given. Everything that
happens to a frame comes back as an :class:`~lmsco_ros.node.outcome.Outcome`, errors included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import threading
import time

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.node.history import FrameHistory, NANOSECONDS
from lmsco_ros.node.mailbox import Mailbox
from lmsco_ros.node.outcome import Frame, Outcome, Phase, Tracker


@dataclass(frozen=True, eq=False)
class _Step:
    frame: Frame
    live: bool = True


@dataclass(frozen=True, eq=False)
class _Start:
    frame: Frame
    box: BoundingBox
    live: bool = False


@dataclass(frozen=True, eq=False)
class _Refuse:
    frame: Frame
    reason: str


@dataclass(frozen=True, eq=False)
class _Reset:
    pass


@dataclass(frozen=True, eq=False)
class _Enable:
    enabled: bool


@dataclass(frozen=True)
class _Request:
    """A start that waits for its frame; without a stamp any frame will do."""

    box: BoundingBox
    stamp: int | None
    made: float

    def wants(self, frame: Frame) -> bool:
        """Tell whether the frame is the one to start on."""
        return self.stamp is None or frame.stamp == self.stamp

    def has_missed(self, frame: Frame, patience: float) -> bool:
        """Tell from a later frame whether the one to start on will not come any more."""
        return self.stamp is not None and (
            frame.stamp > self.stamp or frame.received - self.made > patience)


class TrackerWorker:
    """
    Runs a tracker over frames as they come.

    Parameters
    ----------
    tracker : Tracker
        Used by the worker's thread only.
    deliver : callable
        Called with every outcome, in the worker's thread; must not raise.
    mailbox : Mailbox
        Decides what happens when frames come faster than they are tracked: a
        :class:`~lmsco_ros.node.mailbox.LatestMailbox` drops the older ones, a
        :class:`~lmsco_ros.node.mailbox.BoundedMailbox` lets :meth:`submit` wait.
    history : FrameHistory
        Frames to start on later.

    """

    def __init__(self, tracker: Tracker, deliver: Callable[[Outcome], None], *,
                 mailbox: Mailbox, history: FrameHistory[Frame]) -> None:
        self._tracker = tracker
        self._deliver = deliver
        self._mailbox = mailbox
        self._history = history
        self._intake = threading.Lock()
        self._request: _Request | None = None
        self._dropped = 0
        self._extra_steps = 0
        # The rest belongs to the thread alone.
        self._busy_since: float | None = None
        self._track_id = 0
        self._has_target = False
        self._enabled = True
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
        """Time since the tracker began with the frame that it is at; 0 while it waits."""
        since = self._busy_since
        return 0.0 if since is None else time.monotonic() - since

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
        if self._thread.ident is not None:
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def submit(self, frame: Frame) -> None:
        """Hand over the next frame; waits only when the mailbox keeps all and is full."""
        with self._intake:
            self._history.add(frame)
            request = self._request
            if request is not None and request.wants(frame):
                self._request = None
                self._mailbox.put(_Start(frame, request.box, live=True))
                return
            if request is not None and request.has_missed(frame, self._history.seconds):
                self._request = None
                self._mailbox.put(_Refuse(frame, _unknown_stamp(request.stamp, self._history)))
            if self._extra_steps and self._mailbox.skips_behind(_is_late_step):
                self._extra_steps -= 1
                self._mailbox.put(_Step(frame, live=False))
            else:
                self._dropped += self._mailbox.put_frame(_Step(frame))

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
            first frame, with one no longer than frames are kept.

        """
        with self._intake:
            self._supersede()
            newest = self._history[-1] if self._history else None
            if newest is None or stamp is not None and stamp > newest.stamp:
                self._request = _Request(box, stamp, time.monotonic())
                return
            frames = [newest] if stamp is None else self._history.since(stamp)
            if not frames:
                self._mailbox.put(_Refuse(newest, _unknown_stamp(stamp, self._history)))
                return
            self._mailbox.put(_Start(frames[0], box))
            self._extra_steps = self._history.maxlen
            for frame in frames[1:]:
                self._mailbox.put(_Step(frame, live=False))

    def reset(self) -> None:
        """Drop the target, and a start that still waits for its frame."""
        with self._intake:
            self._supersede()
            self._mailbox.put(_Reset())

    def set_enabled(self, enabled: bool) -> None:
        """Pause, keeping the target, or go on."""
        with self._intake:
            self._mailbox.put(_Enable(enabled))

    def _supersede(self) -> None:
        """Forget what an earlier start still waits for."""
        self._request = None
        self._mailbox.supersede(_is_superseded)

    def _run(self) -> None:
        handlers = {_Step: self._step, _Start: self._begin, _Refuse: self._refuse,
                    _Reset: self._drop_target, _Enable: self._enable}
        while (item := self._mailbox.take()) is not None:
            self._busy_since = time.monotonic()
            handlers[type(item)](item)
            self._busy_since = None

    def _step(self, item: _Step) -> None:
        if not self._enabled:
            self._report(item, Phase.DISABLED)
        elif not self._has_target:
            self._report(item, Phase.IDLE)
        else:
            self._track(item, lambda: self._tracker.update(item.frame.image))

    def _begin(self, item: _Start) -> None:
        if not self._enabled:
            self._report(item, Phase.REFUSED,
                         'cannot start while tracking is disabled; enable it first')
            return

        def start() -> TrackResult:
            result = self._tracker.initialize(item.frame.image, item.box)
            self._track_id += 1
            self._has_target = True
            return result

        self._track(item, start)

    def _refuse(self, item: _Refuse) -> None:
        self._report(item, Phase.REFUSED, item.reason)

    def _drop_target(self, item: _Reset) -> None:
        self._has_target = False

    def _enable(self, item: _Enable) -> None:
        self._enabled = item.enabled

    def _track(self, item: _Step | _Start, work: Callable[[], TrackResult]) -> None:
        """
        Let the tracker work on a frame.

        What the tracker refuses leaves it as it was; anything else that it raises costs the
        target, and only that.
        """
        started = time.monotonic()
        try:
            result = work()
        except LMSCOError as error:
            self._report(item, Phase.REFUSED, str(error), started=started)
        except Exception as error:  # noqa: B902
            self._has_target = False
            self._report(item, Phase.FAILED, f'{type(error).__name__}: {error}', started=started)
        else:
            self._report(item, Phase.TRACKED, result=result, started=started)

    def _report(self, item: _Step | _Start | _Refuse, phase: Phase, error: str = '', *,
                result: TrackResult | None = None, started: float | None = None) -> None:
        if not self._stopping.is_set():
            live = isinstance(item, (_Step, _Start)) and item.live
            finished = time.monotonic()
            self._deliver(Outcome(item.frame, phase, result, self._track_id, live, error,
                                  finished if started is None else started, finished))


def _is_late_step(item: object) -> bool:
    """Tell whether an item belongs to a start in the past that catches up."""
    return isinstance(item, _Step) and not item.live


def _is_superseded(item: object) -> bool:
    """Tell whether a new request leaves no use for an item."""
    return isinstance(item, _Refuse) or isinstance(item, (_Step, _Start)) and not item.live


def _unknown_stamp(stamp: int, history: FrameHistory[Frame]) -> str:
    """Say why a start on a certain frame cannot be met."""
    first, last = history[0].stamp / NANOSECONDS, history[-1].stamp / NANOSECONDS
    return (f'no frame with the stamp {stamp / NANOSECONDS:.9f} is kept (there are '
            f'{len(history)} from {first:.9f} to {last:.9f}); copy the stamp of the image that '
            'the box was found in, or keep frames for longer')
