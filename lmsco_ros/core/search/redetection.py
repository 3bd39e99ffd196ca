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

from lmsco_ros.core.config import SearchConfig
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.observer import Observer, Outlook, Sighting
from lmsco_ros.core.search.salience import Salience
from lmsco_ros.core.search.schedule import Schedule
from lmsco_ros.core.types import BoundingBox, TrackState

__all__ = ['Redetection']

# Sizes of the target that are considered after a cut.
_CUT_SCALES = (1.0, 0.7, 1.4)


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

    def __call__(self, outlook: Outlook, here: Sighting, misses: int, *,
                 after_shutter: bool) -> Sighting:
        """
        Return what convinces most in other places of the image, or what is here.

        Parameters
        ----------
        outlook : Outlook
            The frame.
        here : Sighting
            What is where the target was expected.
        misses : int
            Frames since the target was seen.
        after_shutter : bool
            Whether this is the first frame after a closed shutter.

        """
        self._observer.follow_distractors(outlook)
        hurried = after_shutter or self._monitor.state is not TrackState.LOST
        turn = self._schedule.turn(misses, hurried=hurried, after_shutter=after_shutter)
        seen = self._salient(outlook, turn.salient)
        seen += self._tiles(outlook, here.detection.region.width, turn.slices)
        seen.sort(key=lambda sighting: -sighting.assessment.score)
        return next((other for other in seen if self._prefers(outlook, other, here)), here)

    def _prefers(self, outlook: Outlook, other: Sighting, here: Sighting) -> bool:
        """Return whether the target is rather there than here."""
        return (other.assessment.score > here.assessment.score
                and self._monitor.convincing(other.assessment)
                and not self._observer.is_distractor(outlook, other.detection))

    def _salient(self, outlook: Outlook, chosen: range) -> list[Sighting]:
        """Return what is at the salient places whose turn it is."""
        if not chosen:
            return []
        scales = _CUT_SCALES if self._monitor.after_cut else (1.0,)
        found = self._salience.candidates(
            outlook.view, outlook.expected, self._schedule.candidates, scales)
        return [self._look_at(outlook, box) for box in found[chosen.start:chosen.stop]]

    def _tiles(self, outlook: Outlook, side: float, slices: int) -> list[Sighting]:
        """Return the sharpest detection in the regions whose turn it is."""
        if not slices:
            return []
        places = self._schedule.tiles(outlook.view.size, side, outlook.expected.center, slices)
        found = [self._observer.detect(outlook, outlook.expected.moved_to(place))
                 for place in places]
        if not found:
            return []
        sharpest = max(found, key=lambda detection: detection.sharpness)
        # The window of a tile dims what lies off its center: look again from there.
        return [self._look_at(outlook, outlook.expected.moved_to(sharpest.center))]

    def _look_at(self, outlook: Outlook, box: BoundingBox) -> Sighting:
        """Return what is around a box."""
        return self._observer.weigh(outlook, self._observer.detect(outlook, box), box)
