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

"""The targets of a tracker: how many there may be, which is selected, which are given up."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy.typing as npt

from lmsco_ros.core.errors import LMSCOError
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.history import NANOSECONDS
from lmsco_ros.node.outcome import Place, StartAnswer, Tracker


class FollowedTargets:
    """
    Starts, follows and drops targets; one thread may change them, any may ask.

    Parameters
    ----------
    tracker : Tracker
        Follows them.
    most : int
        So many at once. A start beyond it takes the place of the target that is lost for the
        longest time, or of the selected one where none is lost.
    drop_after : float
        Seconds, by the stamps of the frames, after which a lost target is dropped; 0 keeps it.

    """

    def __init__(self, tracker: Tracker, most: int = 1, drop_after: float = 0.0) -> None:
        self.most = most
        self._tracker = tracker
        self._drop_after = round(drop_after * NANOSECONDS)
        self._lost_since: dict[int, int] = {}
        self._latest = 0
        self._chosen = 0
        self._results: dict[int, TrackResult] = {}

    @property
    def ids(self) -> tuple[int, ...]:
        """Numbers of the targets."""
        return tuple(self._results)

    @property
    def results(self) -> Mapping[int, TrackResult]:
        """What was last said of each target; a mapping that does not change."""
        return self._results

    @property
    def selected(self) -> int:
        """
        Number of the selected target: the chosen one, by default the latest.

        Of the latest that there was where there is none, 0 before the first.
        """
        ids, chosen = self.ids, self._chosen
        return chosen if chosen in ids else max(ids, default=self._latest)

    def select(self, number: int) -> None:
        """Choose a target, until another one is started."""
        self._chosen = number

    def start(self, image: npt.NDArray, time: float, place: Place, *,
              follow: bool) -> tuple[dict[int, TrackResult], StartAnswer]:
        """
        Start on a target.

        Parameters
        ----------
        image : ndarray
            Frame that shows it.
        time : float
            When that was taken, in seconds.
        place : BoundingBox, or tuple of float
            The target, or a point on it.
        follow : bool
            Whether it is the next frame of the others as well.

        Returns
        -------
        tuple
            Results of all whose frame it is, and what became of the start.

        """
        replaced = (self._least,) if len(self._results) >= self.most else ()
        staying = [number for number in self._results if number not in replaced]
        results = dict(self.step(image, time, staying)) if follow and staying else {}
        try:
            number = self._begin(image, time, place, replaced)
        except LMSCOError as error:
            return results, StartAnswer(reason=str(error))
        self._latest, self._chosen = number, number
        first = {number: self._tracker.results[number]}
        self._results = {other: self._results[other] for other in staying} | first
        for other in replaced:
            self._lost_since.pop(other, None)
        return results | first, StartAnswer(number, replaced)

    def step(self, image: npt.NDArray, time: float,
             only: Collection[int] | None = None) -> Mapping[int, TrackResult]:
        """Find the targets, or only some of them, in their next frame."""
        results = self._tracker.update(image, time, only)
        self._results = self._results | dict(results)
        return results

    def learn(self) -> None:
        """Learn from the last frame, while nobody waits for an answer."""
        self._tracker.learn()

    def give_up(self, results: Mapping[int, TrackResult], stamp: int) -> tuple[int, ...]:
        """Drop and return those that are lost for too long in a frame of that stamp."""
        for number, result in results.items():
            since = self._lost_since.pop(number, stamp)
            if result.state is TrackState.LOST:
                # The stamps go backwards where a recording begins anew.
                self._lost_since[number] = min(stamp, since)
        gone = tuple(number for number, since in self._lost_since.items()
                     if number in results and 0 < self._drop_after < stamp - since)
        for number in gone:
            self._tracker.drop(number)
            del self._lost_since[number]
        self._results = {number: result for number, result in self._results.items()
                         if number not in gone}
        return gone

    def clear(self) -> None:
        """Drop all."""
        self._tracker.reset()
        self._results, self._lost_since = {}, {}

    def _begin(self, image: npt.NDArray, time: float, place: Place,
               replaced: Collection[int]) -> int:
        """Let the tracker start."""
        if isinstance(place, BoundingBox):
            return self._tracker.initialize(image, place, time, replaced)
        return self._tracker.initialize_at(image, place, time, replaced)

    @property
    def _least(self) -> int:
        """The target that makes room for another one."""
        return min(self._lost_since, key=self._lost_since.__getitem__, default=self.selected)
