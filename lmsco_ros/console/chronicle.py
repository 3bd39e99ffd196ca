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

"""What happened: starts, losses and finds with thumbnails, and a strip of score and size."""

from __future__ import annotations

import base64
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import threading
import time

from lmsco_ros.console.moments import FOUND, Moment
from msg_adapters.boxes import Box
from msg_adapters.status import FrameStatus

_MOST_EVENTS = 50
_STRIP_SECONDS = 120.0
_SAMPLE_SECONDS = 0.1
# Frames that are further back, in nanoseconds, are those of a recording that starts over.
_LONGEST_CATCH_UP = 10 * 10 ** 9
_LOST, _FOUND, _DROPPED = 'lost', 'found', 'dropped'


@dataclass(frozen=True)
class Event:
    """
    Something that a person wants to know of later.

    Attributes
    ----------
    number : int
        Tells events apart.
    revision : int
        Grows with every event and every change of one.
    kind : str
        accepted, refused, lost, found or dropped.
    track_id : int
        Of the target; 0 for none.
    at : float
        Seconds since 1970.
    text : str
        What the tracker said.
    thumbnail : str
        A JPEG file in base64; empty while there is none.

    """

    number: int
    revision: int
    kind: str
    track_id: int
    at: float
    text: str
    thumbnail: str = ''


@dataclass(frozen=True)
class Sample:
    """
    The selected target at one time.

    Attributes
    ----------
    at : float
        Seconds since 1970.
    state : str
        Its state; empty when the tracker said nothing.
    score, size : float or None
        Score in [0, 1], and the mean side of the box in pixels; None without a box.

    """

    at: float
    state: str
    score: float | None
    size: float | None


class Chronicle:
    """
    Keeps what happened in the last two minutes; safe in every thread.

    Parameters
    ----------
    thumbnail : callable
        Makes the file of a box in a frame.
    clock : callable
        Returns seconds since 1970.

    """

    def __init__(self, thumbnail: Callable[[Moment, Box], bytes],
                 clock: Callable[[], float] = time.time) -> None:
        self._thumbnail = thumbnail
        self._clock = clock
        self._lock = threading.Lock()
        self._events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self._samples: deque[Sample] = deque()
        self._states: dict[int, str] = {}
        self._seen: dict[int, tuple[Moment, Box]] = {}
        self._newest = -1
        self._numbers = 0
        self._revisions = 0

    def hear(self, stamp: int, statuses: Sequence[FrameStatus]) -> None:
        """Note what is told of the frame with a stamp (nanoseconds) that was not so before."""
        with self._lock:
            for status in statuses:
                if status.start:
                    self._note(status.start, status.track_id, status.message)
                if status.state in (*FOUND, _LOST):
                    self._compare(status)
            # While a new target catches up with the newest frame, the others are not told of.
            if not self._newest - _LONGEST_CATCH_UP <= stamp <= self._newest:
                self._newest = stamp
                self._miss(statuses)

    def see(self, moment: Moment) -> None:
        """Take a sample of a frame, and the thumbnails that events wait for."""
        with self._lock:
            self._sample(moment)
            for status in moment.statuses:
                # While it is uncertain, the box may have left the target already.
                box = moment.boxes.get(status.track_id)
                if box is not None and (
                        status.state == 'tracking' or status.track_id not in self._seen):
                    self._seen[status.track_id] = (moment, box)
            for place, event in enumerate(self._events):
                if not event.thumbnail and event.kind in ('accepted', _FOUND) \
                        and event.track_id in moment.boxes:
                    self._events[place] = replace(
                        event, revision=self._revision(), thumbnail=self._picture(event.track_id))

    def since(self, revision: int) -> list[Event]:
        """Return the events that are new, or have changed, since a revision."""
        with self._lock:
            return [event for event in self._events if event.revision > revision]

    def strip(self) -> list[Sample]:
        """Return samples of the last two minutes, ten in a second."""
        with self._lock:
            return list(self._samples)

    def _compare(self, status: FrameStatus) -> None:
        """Note that a target was lost or found."""
        before = self._states.get(status.track_id)
        self._states[status.track_id] = status.state
        if status.state == _LOST and before in FOUND:
            self._note(_LOST, status.track_id, status.message)
        elif status.state in FOUND and before == _LOST:
            self._note(_FOUND, status.track_id, status.message)

    def _miss(self, statuses: Sequence[FrameStatus]) -> None:
        """Note the targets that the status of a frame does not name any more."""
        # What is refused, disabled or broken says nothing of the targets.
        if any(status.state not in (*FOUND, _LOST, 'idle') for status in statuses):
            return
        told = {status.track_id for status in statuses if status.state != 'idle'}
        for track_id in self._states.keys() - told:
            self._note(_DROPPED, track_id, 'no longer followed')
            del self._states[track_id]
            self._seen.pop(track_id, None)

    def _note(self, kind: str, track_id: int, text: str) -> None:
        self._numbers += 1
        picture = self._picture(track_id) if kind in (_LOST, _DROPPED) else ''
        self._events.append(Event(self._numbers, self._revision(), kind, track_id, self._clock(),
                                  text, picture))

    def _picture(self, track_id: int) -> str:
        if track_id not in self._seen:
            return ''
        return base64.b64encode(self._thumbnail(*self._seen[track_id])).decode()

    def _revision(self) -> int:
        self._revisions += 1
        return self._revisions

    def _sample(self, moment: Moment) -> None:
        now = self._clock()
        if self._samples and 0 <= now - self._samples[-1].at < _SAMPLE_SECONDS:
            return
        selected = moment.statuses[0] if moment.statuses else None
        box = moment.boxes.get(selected.track_id) if selected is not None else None
        self._samples.append(Sample(
            now, selected.state if selected is not None else '',
            selected.score if selected is not None else None,
            (box.width * box.height) ** 0.5 if box is not None else None))
        while now - self._samples[0].at > _STRIP_SECONDS:
            self._samples.popleft()
