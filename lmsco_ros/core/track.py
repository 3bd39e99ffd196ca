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

"""One target, from its first frame on."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from lmsco_ros.core.backend import Backend
from lmsco_ros.core.confidence import ConfidenceMonitor, Evidence
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.detection import Detection, Detector
from lmsco_ros.core.distractors import Distractors
from lmsco_ros.core.fourier.localization import centered_map
from lmsco_ros.core.intensity import AutomaticGain
from lmsco_ros.core.networks import Networks
from lmsco_ros.core.pursuit import Pursuit
from lmsco_ros.core.salience import Salience
from lmsco_ros.core.sampling import check_box, clamp_box, FrameView, visible_part
from lmsco_ros.core.scale import credible_change, make_scale_estimator, steady
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.core.verification import Verification

__all__ = ['Sighting', 'Track']

# Searches in which all salient places get their turn; odd, since later every other frame has one.
_TURNS = 3

# Sizes of the target that are considered after a cut.
_CUT_SCALES = (1.0, 0.7, 1.4)


@dataclass(frozen=True)
class Sighting:
    """
    Something that may be the target.

    Attributes
    ----------
    box : BoundingBox
        Where it was looked for, in the size that it was taken to have.
    detection : Detection
        What the filter saw there.
    evidence : Evidence
        What speaks for it.

    """

    box: BoundingBox
    detection: Detection
    evidence: Evidence


class Track:
    """
    State of one target: where it is, how large, and what was learned of it.

    Parameters
    ----------
    config : TrackerConfig
        How to track.
    backend : Backend
        Where the filter is computed.
    networks : Networks
        What the configuration asks for.
    image : ndarray
        First frame.
    box : BoundingBox
        Target in the first frame.

    Raises
    ------
    BoxError
        When the box is too small or not in the image.
    ImageError
        When there is nothing to see in the search region.

    """

    def __init__(self, config: TrackerConfig, backend: Backend, networks: Networks,
                 image: np.ndarray, box: BoundingBox) -> None:
        self.image_shape, self.image_type = image.shape, image.dtype
        check_box(box, self._image_size)
        self._config = config
        self._box, self._first_size = box, box.size
        self._frame = 0
        self._frozen = 0
        self._gain = AutomaticGain(config.intensity)
        self._monitor = ConfidenceMonitor(config.confidence)
        view = FrameView(image, self._gain.examine(image).intensity)
        self._detector = Detector(config, backend, networks, view, box)
        self._distractors = Distractors()
        self._pursuit = Pursuit(config.confidence.tiles)
        self._scale = make_scale_estimator(config.scale, box.size)
        self._scale.learn(view, box)
        self._presence: float | None = None
        self._verification = None if networks.verification is None else Verification(
            networks.verification, view, box)
        self._salience = Salience(view, box)
        first = self._detector(view, box)
        self._first_peak = first.peak.value
        self._first_likeness = self._detector.likeness(first)
        self._follow(view, box)
        self._detector.watch(view, box)
        self.result = self._describe(first, 1.0, TrackState.TRACKING)

    def advance(self, image: np.ndarray) -> TrackResult:
        """Find the target in the next frame, and learn from it if it can be trusted."""
        condition = self._gain.examine(image)
        if condition.frozen:
            self._frozen += 1
            return self.result
        self._frame += 1
        if condition.cut:
            self._start_over()
        view = FrameView(image, condition.intensity)
        expected = self._pursuit.expected(self._box, view.size)
        sighting = self._look(view, expected)
        if self._frozen or not self._monitor.believable(sighting.evidence):
            sighting = self._search_elsewhere(view, expected, sighting)
        self._frozen = 0
        believed = self._monitor.believable(sighting.evidence)
        state = self._monitor.judge(sighting.evidence)
        self._presence = sighting.evidence.presence
        if believed:
            self._follow(view, self._resized(view, sighting))
        else:
            self._pursuit.missed()
        if self._monitor.learns:
            self._learn(view, sighting.detection)
        self._detector.watch(view, self._pursuit.expected(self._box, view.size))
        self.result = self._describe(
            sighting.detection, self._monitor.score(sighting.evidence), state)
        return self.result

    @property
    def _image_size(self) -> tuple[int, int]:
        """Width and height of the images."""
        return self.image_shape[1], self.image_shape[0]

    @property
    def _trains(self) -> bool:
        """Whether the filter is trained in this frame."""
        return self._frame % self._config.learning.update_interval == 0

    @property
    def _spared(self) -> bool:
        """Whether this frame, which trains, leaves the comparison to the next one."""
        return self._trains and self._config.learning.update_interval > 1

    def _describe(self, detection: Detection, score: float, state: TrackState) -> TrackResult:
        """Return what there is to say; the target in the first frame scores 1 in the map."""
        confidence_map = centered_map(detection.peak.grid / self._first_peak)
        box = steady(self._box, self._first_size, self._config.scale.tolerance)
        shown = visible_part(box, self._image_size)
        return TrackResult(shown, score, state, confidence_map, detection.region)

    def _start_over(self) -> None:
        """Expect nothing of a view that has changed at once, but that it shows the target."""
        self._monitor.cut()
        self._pursuit.cut()
        self._distractors.forget()

    def _look(self, view: FrameView, expected: BoundingBox) -> Sighting:
        """Return the best detection, or where the target is expected if that is a distractor."""
        self._distractors.next_frame()
        detection = self._detector(view, expected, self._scale.search_factors)
        if self._is_distractor(detection):
            detection = self._detector.near(detection, expected.center)
        if self._spared:
            as_before = self._sighting(detection, expected, self._presence)
            if self._monitor.beyond_doubt(as_before.evidence):
                return as_before
        return self._weigh(view, detection, expected)

    def _is_distractor(self, detection: Detection) -> bool:
        """Return whether something else than the target was detected; if so, note its place."""
        return self._distractors.explain(detection.center, self._box, self._resembles)

    def _resembles(self, view: FrameView, box: BoundingBox) -> bool:
        """Return whether a frame shows something like the target in a box."""
        seen = self._detector.near(self._detector(view, box), box.center)
        return self._monitor.similar(self._weigh(view, seen, box).evidence)

    def _weigh(self, view: FrameView, detection: Detection, box: BoundingBox) -> Sighting:
        """Return a detection around a box, compared with the first frame."""
        presence = None if self._verification is None else self._verification(
            view, box.moved_to(detection.center))
        return self._sighting(detection, box, presence)

    def _sighting(self, detection: Detection, box: BoundingBox,
                  presence: float | None) -> Sighting:
        """Return a detection around a box with all that speaks for it."""
        likeness = self._detector.likeness(detection) / self._first_likeness
        expected = self._pursuit.expected(self._box, self._image_size)
        jump = math.dist(detection.center, expected.center) / expected.area**0.5
        return Sighting(box, detection, Evidence(detection.sharpness, likeness, presence, jump))

    def _search_elsewhere(self, view: FrameView, expected: BoundingBox,
                          here: Sighting) -> Sighting:
        """Return what convinces most in other places of the image, or what is here."""
        # A distractor has to be watched, or it gets away from its place and looks new.
        for place in self._distractors.places:
            self._is_distractor(self._detector(view, expected.moved_to(place)))
        # In the long run they take turns, so that a frame without the target costs less.
        hurry = self._frozen or self._monitor.state is not TrackState.LOST
        seen = []
        if hurry or self._pursuit.misses % 2 == 0:
            seen += self._search_salient(view, expected)
        if hurry or self._pursuit.misses % 2 == 1:
            seen += self._search_tiles(view, expected, here.detection.region.width)
        seen.sort(key=lambda sighting: -self._monitor.score(sighting.evidence))
        least = self._monitor.score(here.evidence)
        for other in seen:
            if (self._monitor.score(other.evidence) > least
                    and self._monitor.convincing(other.evidence)
                    and not self._is_distractor(other.detection)):
                return other
        return here

    def _search_salient(self, view: FrameView, expected: BoundingBox) -> list[Sighting]:
        """Return what is at the salient places whose turn it is."""
        count = self._config.confidence.candidates
        if not count:
            return []
        scales = _CUT_SCALES if self._monitor.after_cut else (1.0,)
        found = self._salience.candidates(view, expected, _TURNS * count, scales)
        first = self._pursuit.misses % _TURNS * count
        return [self._weigh(view, self._detector(view, box), box)
                for box in found[first:first + count]]

    def _search_tiles(self, view: FrameView, expected: BoundingBox,
                      side: float) -> list[Sighting]:
        """Return the sharpest detection in the regions whose turn it is."""
        # While the shutter was closed the target may have got further than in a frame.
        slices = 2 if self._frozen else 1
        places = self._pursuit.slice(view.size, side, expected.center, slices)
        found = [self._detector(view, expected.moved_to(place)) for place in places]
        if not found:
            return []
        sharpest = max(found, key=lambda detection: detection.sharpness)
        # The window of a tile dims what lies off its center: look again from there.
        box = expected.moved_to(sharpest.center)
        return [self._weigh(view, self._detector(view, box), box)]

    def _resized(self, view: FrameView, sighting: Sighting) -> BoundingBox:
        """Return the box at a sighting, in the size of the target there."""
        detection = sighting.detection
        scale = self._scale.found_factor(detection.peak.scale_values)
        moved = clamp_box(sighting.box.moved_to(detection.center).scaled(scale), view.size)
        change = self._scale.estimate(view, moved)
        change = credible_change(change, moved, self._config.scale.damping)
        return clamp_box(moved.scaled(change), view.size)

    def _follow(self, view: FrameView, box: BoundingBox) -> None:
        """Move to where the target is."""
        self._box = box
        self._pursuit.seen(box.center)
        certain = self._monitor.state is TrackState.TRACKING
        if certain and self._config.confidence.distractors:
            self._distractors.certain(view, box)

    def _learn(self, view: FrameView, detection: Detection) -> None:
        """Store the sample; when it is time, train the filter and the scale estimator."""
        self._detector.remember(detection)
        if self._trains:
            self._detector.train()
            self._scale.learn(view, self._box)
