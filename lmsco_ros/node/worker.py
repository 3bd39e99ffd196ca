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
happens to a frame comes back as an :class:`Outcome`, errors included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
import threading
import time
from typing import Any, Protocol

import numpy.typing as npt

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.node.history import FrameHistory, NANOSECONDS
from lmsco_ros.node.mailbox import Mailbox


class Tracker(Protocol):
    """The part of the tracker that the worker uses."""

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> TrackResult:
        """Start on a target."""

    def update(self, image: npt.NDArray) -> TrackResult:
        """Find the target in the next frame."""


@dataclass(frozen=True, eq=False)
class Frame:
    """
    One image on its way to the tracker.

    Attributes
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        Not changed by anybody from here on.
    stamp : int
        When it was taken, in nanoseconds.
    received : float
        When it arrived, on the clock of `time.monotonic`.
    context : Any
        Whatever the sender wants to get back with the outcome.

    """

    image: npt.NDArray
    stamp: int
    received: float
    context: Any = None


class Phase(Enum):
    """What became of a frame."""

    TRACKED = 'tracked'
    IDLE = 'idle'
    DISABLED = 'disabled'
    REFUSED = 'refused'
    FAILED = 'failed'


@dataclass(frozen=True, eq=False)
class Outcome:
    """
    What the tracker has to say about one frame.

    Attributes
    ----------
    frame : Frame
    phase : Phase
        TRACKED (there is a result), IDLE (no target), DISABLED, REFUSED (a request or a
        frame could not be used; nothing changed) or FAILED (the tracker raised; the target is
        dropped).
    result : TrackResult or None
        Only when TRACKED.
    track_id : int
        Number of the start that the result belongs to; 0 before the first.
    live : bool
        False for frames that are gone through again after a start in the past.
    error : str
        Why the request was refused or the target dropped.
    tracker_seconds : float
        Time spent in the tracker.
    latency_seconds : float
        From the frame's arrival until now.

    """

    frame: Frame
    phase: Phase
    result: TrackResult | None
    track_id: int
    live: bool
    error: str
    tracker_seconds: float
    latency_seconds: float


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
        Called with every :class:`Outcome`, in the worker's thread; must not raise.
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
        # The rest belongs to the thread alone.
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
            since are gone through again. By default the newest frame is taken. A start
            whose frame is still to come waits for it: without a stamp for the first frame,
            with one no longer than frames are kept.

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
        self._mailbox.supersede(
            lambda item: isinstance(item, (_Step, _Start)) and not item.live)

    def _run(self) -> None:
        handlers = {_Step: self._step, _Start: self._begin, _Refuse: self._refuse,
                    _Reset: self._drop_target, _Enable: self._enable}
        while (item := self._mailbox.take()) is not None:
            handlers[type(item)](item)

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
        began = time.monotonic()
        try:
            result = work()
        except LMSCOError as error:
            self._report(item, Phase.REFUSED, str(error), seconds=time.monotonic() - began)
        except Exception as error:  # noqa: B902
            self._has_target = False
            self._report(item, Phase.FAILED, f'{type(error).__name__}: {error}',
                         seconds=time.monotonic() - began)
        else:
            self._report(item, Phase.TRACKED, result=result, seconds=time.monotonic() - began)

    def _report(self, item: _Step | _Start | _Refuse, phase: Phase, error: str = '', *,
                result: TrackResult | None = None, seconds: float = 0.0) -> None:
        if not self._stopping.is_set():
            live = isinstance(item, (_Step, _Start)) and item.live
            self._deliver(Outcome(item.frame, phase, result, self._track_id, live, error,
                                  seconds, time.monotonic() - item.frame.received))


def _unknown_stamp(stamp: int, history: FrameHistory[Frame]) -> str:
    """Say why a start on a certain frame cannot be met."""
    first, last = history[0].stamp / NANOSECONDS, history[-1].stamp / NANOSECONDS
    return (f'no frame with the stamp {stamp / NANOSECONDS:.9f} is kept (there are '
            f'{len(history)} from {first:.9f} to {last:.9f}); copy the stamp of the image that '
            'the box was found in, or keep frames for longer')
