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

"""Re-detection: what convinces elsewhere, when the target is not where it was expected."""

from __future__ import annotations

from collections.abc import Callable
import math

from lmsco_ros.core.config import SearchConfig
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.observer import Observer, Outlook, Sighting
from lmsco_ros.core.search.salience import Salience
from lmsco_ros.core.search.schedule import Schedule, Turn
from lmsco_ros.core.types import BoundingBox

__all__ = ['Redetection']

# Sizes of the target that are considered after a cut.
_CUT_SCALES = (1.0, 0.7, 1.4)
# Salient places among which those around a place are found; around means so many sides away.
_MANY, _NEAR = 48, 6.0


class Redetection:
    """
    Searches the image for a target that is not where it was expected.

    Parameters
    ----------
    config : SearchConfig
        How much is searched in a frame.
    observer : Observer
        Looks, and knows the distractors.
    monitor : PresenceMonitor
        Says what convinces.
    view : FrameView
        First frame.
    box : BoundingBox
        The target in it.

    """

    def __init__(self, config: SearchConfig, observer: Observer, monitor: PresenceMonitor,
                 view: FrameView, box: BoundingBox) -> None:
        self._observer = observer
        self._monitor = monitor
        self._salience = Salience(view, box)
        self._schedule = Schedule(config)

    def restart(self) -> None:
        """Begin the next search anew: the target was seen, or the view has changed."""
        self._schedule.restart()

    def __call__(self, outlook: Outlook, here: Sighting, *,
                 after_shutter: bool) -> Sighting:
        """
        Return what convinces most in other places of the image, or what is here.

        Parameters
        ----------
        outlook : Outlook
            The frame.
        here : Sighting
            What is where the target was expected.
        after_shutter : bool
            Whether this is the first frame after a closed shutter.

        """
        self._observer.follow_distractors(outlook)
        if after_shutter or self._monitor.hurried:
            seen = self._hurried(outlook, here, 2 if after_shutter else 1)
        else:
            seen = self._sparing(outlook, here)
        seen.sort(key=lambda sighting: -sighting.assessment.score)
        return next((other for other in seen if self._prefers(outlook, other, here)), here)

    def _prefers(self, outlook: Outlook, other: Sighting, here: Sighting) -> bool:
        """Return whether the target is rather there than here."""
        return (other.assessment.score > here.assessment.score
                and self._monitor.convincing(other.assessment)
                and not self._observer.is_distractor(outlook, other.detection))

    def _hurried(self, outlook: Outlook, here: Sighting,
                 slices: int) -> list[Sighting]:
        """Return what is at salient places and in slices, at the price of several frames."""
        chosen = self._schedule.salient(outlook.misses)
        places = self._salient(outlook, self._schedule.candidates) if chosen else []
        return self._look_at(outlook, [*places[chosen.start:chosen.stop],
                                       *self._sharpest(outlook, here, slices)])

    def _sparing(self, outlook: Outlook, here: Sighting) -> list[Sighting]:
        """Return what is where the turn is, if anything is: it costs little more than a frame."""
        turn = self._schedule.turn(outlook.misses)
        if turn is Turn.TILES:
            return self._look_at(outlook, self._sharpest(
                outlook, here, 1, self._monitor.hints))
        chosen = self._schedule.measured(outlook.misses)
        places = self._salient(outlook, _MANY) if chosen else []
        if turn is Turn.ANYWHERE:
            places = places[chosen.start:chosen.stop]
        else:
            center = (outlook.last if turn is Turn.NEAR else outlook.predicted).center
            reach = _NEAR * outlook.expected.area**0.5
            places = [box for box in places if math.dist(box.center, center) < reach]
        best = self._most_present(outlook, places[:len(chosen)])
        return [] if best is None else self._look_at(outlook, [best])

    def _most_present(self, outlook: Outlook, places: list[BoundingBox]) -> BoundingBox | None:
        """Return the place that the network takes for the target, or the first without one."""
        measured = zip(self._observer.presence(outlook, places), places, strict=True)
        known = [(presence, box) for presence, box in measured
                 if presence is None or self._monitor.present(presence)]
        return max(known, key=lambda one: one[0] or 0.0, default=(None, None))[1]

    def _salient(self, outlook: Outlook, count: int) -> list[BoundingBox]:
        """Return so many salient places at most."""
        scales = _CUT_SCALES if self._monitor.after_cut else (1.0,)
        return self._salience.candidates(outlook.view, outlook.expected, count, scales)

    def _sharpest(self, outlook: Outlook, here: Sighting, slices: int,
                  wanted: Callable[[float], bool] = lambda sharpness: True) -> list[BoundingBox]:
        """
        Return where the filter sees most in the regions whose turn it is, if that is wanted.

        It has to look there again: the window of a region dims what lies off its center.
        """
        regions = [outlook.expected.moved_to(place) for place in self._schedule.tiles(
            outlook.view.size, here.detection.region.width, outlook.expected.center, slices)]
        seen = [one for one in self._observer.detect(outlook, regions) if wanted(one.sharpness)]
        sharpest = sorted(seen, key=lambda detection: -detection.sharpness)[:1]
        return [outlook.expected.moved_to(detection.center) for detection in sharpest]

    def _look_at(self, outlook: Outlook, boxes: list[BoundingBox]) -> list[Sighting]:
        """Return what is around boxes."""
        return self._observer.weigh(outlook, self._observer.detect(outlook, boxes), boxes)
