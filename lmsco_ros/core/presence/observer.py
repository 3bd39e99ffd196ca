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

"""A detection with all that speaks for it, told apart from distractors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from lmsco_ros.core.config import ScaleConfig
from lmsco_ros.core.detection.detector import Detection, Detector
from lmsco_ros.core.detection.scale import found_factor
from lmsco_ros.core.extent.measurement import ExtentMeter, Measurement
from lmsco_ros.core.imaging.regions import held_at_border
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import Asking, side_by_side
from lmsco_ros.core.presence.distractors import Distractors
from lmsco_ros.core.presence.evidence import Assessment, Evidence
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.neighbors import Neighbors
from lmsco_ros.core.types import BoundingBox

__all__ = ['Observer', 'Outlook', 'Sighting']


@dataclass(frozen=True)
class Outlook:
    """
    A frame, before the target is looked for in it.

    Attributes
    ----------
    view : FrameView
        The frame.
    last : BoundingBox
        The target where it was seen last, in the view of this frame.
    expected : BoundingBox
        Where it is expected in this frame.
    predicted : BoundingBox
        Where its motion has led it meanwhile.
    neighbors : Neighbors or None
        Other targets; None where there are none.
    misses : int
        Frames since the target was seen.

    """

    view: FrameView
    last: BoundingBox
    expected: BoundingBox
    predicted: BoundingBox
    neighbors: Neighbors | None = None
    misses: int = 0

    def come_in(self, box: BoundingBox) -> BoundingBox:
        """Return the target in a box as large as before, up to a border that cut it just then."""
        return box if self.misses else held_at_border(box, self.last, self.view.size)

    def is_neighbor(self, detection: Detection) -> bool:
        """Return whether another target was detected."""
        return self.neighbors is not None and self.neighbors.claim(
            detection.center, self.expected.area**0.5)


@dataclass(frozen=True)
class Sighting:
    """
    Something that may be the target.

    Attributes
    ----------
    found : BoundingBox
        Where it is, in the size that was looked for, and up to the border that still cuts it.
    detection : Detection
        What the filter saw there.
    assessment : Assessment
        What speaks for it.
    measurement : Measurement or None
        Its extent; None where nothing measures, or where this was spared.

    """

    found: BoundingBox
    detection: Detection
    assessment: Assessment
    measurement: Measurement | None

    def sized(self, scale: ScaleConfig) -> BoundingBox:
        """Return that box in the size that was found, where several were searched."""
        return self.found.scaled(found_factor(scale, self.detection.peak.scale_values))


class Observer:
    """
    Looks with the filter, measures with the network, and knows the distractors.

    Parameters
    ----------
    detector : Detector
        Of the target.
    meter : ExtentMeter or None
        Measures the extent, and knows the target of the first frame.
    monitor : PresenceMonitor
        Weighs the evidence.
    first : Detection
        What the detector sees in the first frame.

    """

    def __init__(self, detector: Detector, meter: ExtentMeter | None,
                 monitor: PresenceMonitor, first: Detection) -> None:
        self._meter = meter
        self._monitor = monitor
        self._distractors = Distractors()
        self.begin(detector, first)

    def begin(self, detector: Detector, first: Detection) -> None:
        """Look with a detector from now on, which sees the target in its first frame so."""
        self._detector = detector
        self._first_likeness = detector.likeness(first)
        self._first_sharpness = first.sharpness

    def introduce(self, view: FrameView, box: BoundingBox) -> Evidence:
        """Return what speaks for the target in its box of the first frame."""
        measured = None if self._meter is None else self._meter(view, box)
        return Evidence(self._first_sharpness, 1.0, *_told(measured, box))

    def look(self, outlook: Outlook, factors: Sequence[float]) -> Asking[Sighting]:
        """
        Return what is around the expected place, or just there where that is a distractor.

        It asks the networks, so that several targets may be looked for together.

        Parameters
        ----------
        outlook : Outlook
            The frame; called once for each.
        factors : sequence of float
            Scales at which the target is searched.

        """
        self._distractors.next_frame()
        detection = yield from self._detector.ask(outlook.view, outlook.expected, factors)
        if outlook.neighbors is not None and outlook.is_neighbor(detection):
            detection = self._detector.near(
                detection, outlook.neighbors.own, outlook.neighbors.owned)
        if self._monitor.hurried and self.is_distractor(outlook, detection):
            detection = self._detector.near(detection, outlook.expected.center)
        sighting = yield from self._ask(outlook, detection, self._found(outlook, detection))
        if self._monitor.hurried or not self._monitor.believable(sighting.assessment):
            return sighting
        # To look back for a distractor costs as much as a frame: a lost target waits for what
        # would be believed.
        if self.is_distractor(outlook, detection):
            detection = self._detector.near(detection, outlook.expected.center)
            sighting = yield from self._ask(outlook, detection, self._found(outlook, detection))
        return sighting

    def _found(self, outlook: Outlook, detection: Detection) -> BoundingBox:
        """Return the target, as large as before, where it was detected."""
        box = outlook.expected.moved_to(detection.center)
        # Without a measurement, nothing would say where it ends.
        return box if self._meter is None else outlook.come_in(box)

    def detect(self, outlook: Outlook, boxes: Sequence[BoundingBox]) -> list[Detection]:
        """Return what the filter sees around boxes, each in its size, in one pass."""
        asked = {place: self._detector.ask(outlook.view, box) for place, box in enumerate(boxes)}
        return list(side_by_side(asked).values())

    def weigh(self, outlook: Outlook, seen: Sequence[Detection],
              boxes: Sequence[BoundingBox]) -> list[Sighting]:
        """Return detections around boxes, measured, with all that speaks for them."""
        asked = {place: self._ask(outlook, detection, box.moved_to(detection.center))
                 for place, (detection, box) in enumerate(zip(seen, boxes, strict=True))}
        return list(side_by_side(asked).values())

    def presence(self, outlook: Outlook, boxes: Sequence[BoundingBox]) -> list[float | None]:
        """Return the log-odds that the target is in each box; None where nothing measures."""
        if self._meter is None:
            return [None] * len(boxes)
        asked = {place: self._meter.ask(outlook.view, box) for place, box in enumerate(boxes)}
        return [measured.presence for measured in side_by_side(asked).values()]

    def _ask(self, outlook: Outlook, detection: Detection,
             found: BoundingBox) -> Asking[Sighting]:
        """Return a detection as `weigh` does, and ask for what is measured of it."""
        measured = None if self._meter is None else (
            yield from self._meter.ask(outlook.view, found))
        likeness = self._detector.likeness(detection) / self._first_likeness
        jump = math.dist(detection.center, outlook.expected.center) / outlook.expected.area**0.5
        presence, vagueness = _told(measured, found)
        evidence = Evidence(detection.sharpness, likeness, presence, vagueness, jump)
        return Sighting(found, detection, self._monitor.assess(evidence), measured)

    def is_distractor(self, outlook: Outlook, detection: Detection) -> bool:
        """Return whether something else than the target was detected; if so, note its place."""
        return outlook.is_neighbor(detection) or self._distractors.explain(
            detection.center, outlook.last, self._resembles)

    def follow_distractors(self, outlook: Outlook) -> None:
        """Watch the known distractors, or they get away from their places and look new."""
        boxes = [outlook.expected.moved_to(place) for place in self._distractors.places]
        for detection in self.detect(outlook, boxes):
            self.is_distractor(outlook, detection)

    def keep(self, view: FrameView, box: BoundingBox) -> None:
        """Keep a frame in which the target is certain, to see later what stood beside it."""
        self._distractors.certain(view, box)

    def forget(self) -> None:
        """Forget what stood where: the view has changed."""
        self._distractors.forget()

    def _resembles(self, view: FrameView, box: BoundingBox) -> bool:
        """Return whether a frame shows something like the target in a box."""
        outlook = Outlook(view, box, box, box)
        seen = [self._detector.near(found, box.center) for found in self.detect(outlook, [box])]
        [sighting] = self.weigh(outlook, seen, [box])
        return self._monitor.resembles(sighting.assessment.evidence)


def _told(measured: Measurement | None,
          box: BoundingBox) -> tuple[float, float] | tuple[None, None]:
    """Return presence and vagueness of what was measured at a box; None where nothing was."""
    if measured is None:
        return None, None
    return measured.presence, float(measured.deviations.mean()) / box.area**0.5
