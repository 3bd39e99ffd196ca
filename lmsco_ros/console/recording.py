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

"""A recording that is played, stepped through and marked in the page."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Iterator
import threading
import time

from lmsco_ros.console.desk import Answer
from lmsco_ros.console.marks import Marks
from lmsco_ros.console.moments import Moment
from lmsco_ros.console.requests import RequestError
from lmsco_ros.replay.errors import ReplayError
from lmsco_ros.replay.frame import RecordedFrame
from lmsco_ros.replay.sources import Source
from msg_adapters.boxes import Box
from msg_adapters.status import FrameStatus

_MOST_BYTES = 256 * 10 ** 6
_LONGEST_PAUSE = 1.0
_END_SECONDS = 1.0
_TARGET = 1


class Recording:
    """
    Frames by number, read in order and kept as long as there is room; safe in every thread.

    To go back behind what is kept, the recording is read again from its start.

    Parameters
    ----------
    source : Source
        The recording.

    Attributes
    ----------
    stamps : dict of int to int
        Stamps of all frames that were read, by their index.

    """

    def __init__(self, source: Source) -> None:
        self.stamps: dict[int, int] = {}
        self._source = source
        self._length = len(source)
        self._lock = threading.Lock()
        self._kept: OrderedDict[int, RecordedFrame] = OrderedDict()
        self._bytes = 0
        self._rest: Iterator[RecordedFrame] = iter(source)
        self._next = 0

    def __len__(self) -> int:
        """Return the number of frames, as stated until the end was read."""
        return self._length

    def at(self, index: int) -> RecordedFrame | None:
        """
        Return a frame, or the last one where there are fewer; None when there is none.

        Raises
        ------
        SourceError
            When the recording cannot be read.

        """
        with self._lock:
            index = max(0, min(index, self._length - 1))
            if index not in self._kept and index < self._next:
                self._rest, self._next = iter(self._source), 0
            while index not in self._kept and self._read():
                pass
            return self._kept.get(min(index, self._length - 1))

    def index_of(self, stamp: int) -> int:
        """
        Return the frame with a stamp.

        Raises
        ------
        RequestError
            When no frame that was shown has it.

        """
        with self._lock:
            for index, each in self.stamps.items():
                if each == stamp:
                    return index
        raise RequestError('the stamp is that of no frame of the recording; load the page anew')

    def _read(self) -> bool:
        """Read one more frame; tell whether there was one."""
        try:
            frame = next(self._rest, None)
        except ReplayError:
            # What is read from then on would begin anywhere.
            self._rest, self._next = iter(self._source), 0
            raise
        if frame is None:
            self._length = self._next
            return False
        self._kept[self._next] = frame
        self.stamps[self._next] = frame.stamp_ns
        self._bytes += frame.image.nbytes
        self._next += 1
        self._length = max(self._length, self._next)
        while self._bytes > _MOST_BYTES and len(self._kept) > 1:
            _, oldest = self._kept.popitem(last=False)
            self._bytes -= oldest.image.nbytes
        return True


class Annotator:
    """
    Has a person mark one target in a recording; stands in the place of the tracker.

    Parameters
    ----------
    recording : Recording
        What is marked.
    marks : Marks
        Where the marks go.

    """

    def __init__(self, recording: Recording, marks: Marks) -> None:
        self.recording = recording
        self._marks = marks

    def moment(self, index: int) -> Moment | None:
        """
        Return a frame with what is known of the target in it; None when there is none.

        Raises
        ------
        RequestError
            When the recording cannot be read.

        """
        try:
            frame = self.recording.at(index)
        except ReplayError as error:
            raise RequestError(str(error)) from error
        if frame is None:
            return None
        state, box = self._marks.at(frame.index)
        status = FrameStatus(state, _TARGET if box else 0, None, 0.0, 0.0, 0, message=state)
        return Moment(frame.index + 1, frame.stamp_ns, time.monotonic(), frame.image, (status,),
                      {_TARGET: box} if box else {})

    def start(self, stamp: int, box: tuple[float, float, float, float]) -> None:
        """Mark the frame with a stamp."""
        self._mark(stamp, lambda index: self._marks.set(index, Box(*box)))

    def mark_absent(self, stamp: int) -> None:
        """Mark the frame with a stamp as one without the target."""
        self._mark(stamp, lambda index: self._marks.set(index, None))

    def unmark(self, stamp: int) -> None:
        """Take the mark of the frame with a stamp away."""
        self._mark(stamp, self._marks.remove)

    def point(self, stamp: int, x: float, y: float) -> None:
        """Refuse: there is no tracker that would find the extent."""
        raise RequestError('a click marks nothing in a recording; drag a box')

    def select(self, track_id: int) -> None:
        """Do nothing: there is one target."""

    def reset(self, answer: Answer) -> None:
        """Refuse."""
        answer(False, 'a recording has no tracker to reset')

    def enable(self, on: bool, answer: Answer) -> None:
        """Refuse."""
        answer(False, 'a recording has no tracker to stop')

    def record(self, on: bool, answer: Answer) -> None:
        """Refuse."""
        answer(False, 'what is shown is a recording')

    def want_map(self, who: object, wanted: bool) -> None:
        """Do nothing: there are no maps."""

    def _mark(self, stamp: int, change: Callable[[int], None]) -> None:
        """Change what is known of the frame with a stamp."""
        try:
            change(self.recording.index_of(stamp))
        except OSError as error:
            raise RequestError(f'the mark is not kept, as it cannot be written: {error}'
                               ) from error


class RecordedFrames:
    """
    The frames for one page, which plays and steps as it likes.

    Parameters
    ----------
    annotator : Annotator
        Makes them.

    """

    def __init__(self, annotator: Annotator) -> None:
        self._annotator = annotator
        self._stamp: int | None = None
        self._shown = 0.0

    async def after(self, number: int) -> Moment | None:
        """Return the next frame when its time has come; None at the end."""
        if number >= len(self._annotator.recording):
            await asyncio.sleep(_END_SECONDS)
            return None
        moment = await asyncio.to_thread(self._annotator.moment, number)
        if moment is None or moment.number <= number:
            return None
        if self._stamp is not None:
            apart = min(max((moment.stamp - self._stamp) / 1e9, 0.0), _LONGEST_PAUSE)
            await asyncio.sleep(max(0.0, self._shown + apart - time.monotonic()))
        return self._told(moment)

    async def beside(self, number: int, steps: int) -> Moment | None:
        """Return the frame some steps from that of a number."""
        moment = await asyncio.to_thread(self._annotator.moment, number - 1 + steps)
        return None if moment is None else self._told(moment)

    def close(self) -> None:
        """Nothing is held."""

    def _told(self, moment: Moment) -> Moment:
        self._stamp, self._shown = moment.stamp, time.monotonic()
        return moment
