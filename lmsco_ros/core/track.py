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

import numpy as np

from lmsco_ros.core.backend import Backend
from lmsco_ros.core.confidence import ConfidenceMonitor, Evidence
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.detection import Detection, Detector
from lmsco_ros.core.fourier.localization import centered_map
from lmsco_ros.core.intensity import AutomaticGain
from lmsco_ros.core.networks import Networks
from lmsco_ros.core.registration import Registration
from lmsco_ros.core.sampling import check_box, clamp_box, FrameView, search_tiles
from lmsco_ros.core.scale import make_scale_estimator
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState

__all__ = ['Track']


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
        check_box(box, (image.shape[1], image.shape[0]))
        self._config = config
        self._box = box
        self._frame = 0
        self._tile = 0
        self._gain = AutomaticGain(config.intensity)
        self._monitor = ConfidenceMonitor(config.confidence)
        view = FrameView(image, self._gain.examine(image).intensity)
        self._detector = Detector(config, backend, networks, view, box)
        self._scale = make_scale_estimator(config.scale, box.size)
        self._scale.learn(view, box)
        self._registration = Registration(
            config.registration, networks.registration, view, box) if (
            networks.registration is not None) else None
        first = self._detector(view, box)
        self._first_peak = first.peak.value
        self._detector.watch(view, box)
        self.result = self._describe(first, 1.0, TrackState.TRACKING)

    def advance(self, image: np.ndarray) -> TrackResult:
        """Find the target in the next frame, and learn from it if it can be trusted."""
        condition = self._gain.examine(image)
        if condition.frozen:
            return self.result
        self._frame += 1
        view = FrameView(image, condition.intensity)
        detection = self._detector(view, self._box, self._scale.search_factors)
        evidence = self._weigh(view, detection)
        if not self._monitor.believable(evidence):
            detection, evidence = self._search_elsewhere(view, detection, evidence)
        believed = self._monitor.believable(evidence)
        state = self._monitor.judge(evidence)
        if believed:
            self._follow(view, detection)
            self._learn(view, detection)
        self._detector.watch(view, self._box)
        self.result = self._describe(detection, self._monitor.score(evidence), state)
        return self.result

    def _describe(self, detection: Detection, score: float, state: TrackState) -> TrackResult:
        """Return what there is to say; the target in the first frame scores 1 in the map."""
        confidence_map = centered_map(detection.peak.grid / self._first_peak)
        return TrackResult(self._box, score, state, confidence_map, detection.region)

    def _weigh(self, view: FrameView, detection: Detection) -> Evidence:
        """Return what speaks for a detection."""
        if self._registration is None:
            return Evidence(detection.sharpness)
        found = self._registration(view, self._box.moved_to(detection.center))
        return Evidence(detection.sharpness, found.presence)

    def _search_elsewhere(self, view: FrameView, here: Detection,
                          evidence: Evidence) -> tuple[Detection, Evidence]:
        """Return a convincing detection in the next tiles of the image, or the one here."""
        tiles = search_tiles(view.size, here.region.width, self._box.center)
        count = min(self._config.confidence.tiles, len(tiles))
        chosen = [tiles[(self._tile + i) % len(tiles)] for i in range(count)]
        self._tile += count
        if not chosen:
            return here, evidence
        best = max((self._detector(view, self._box.moved_to(center)) for center in chosen),
                   key=lambda detection: detection.sharpness)
        # The window of a tile dims what lies off its center: look again from there.
        best = self._detector(view, self._box.moved_to(best.center))
        found = self._weigh(view, best)
        return (best, found) if self._monitor.convincing(found) else (here, evidence)

    def _follow(self, view: FrameView, detection: Detection) -> None:
        """Move the box to the detection and adapt its size."""
        self._tile = 0
        scale = self._scale.found_factor(detection.peak.scale_values)
        moved = clamp_box(self._box.moved_to(detection.center).scaled(scale), view.size)
        moved = moved.scaled(self._scale.estimate(view, moved))
        if self._registration is not None:
            moved = self._registration(view, moved).box
        self._box = clamp_box(moved, view.size)

    def _learn(self, view: FrameView, detection: Detection) -> None:
        """Store the sample; when it is time, train the filter and the scale estimator."""
        self._detector.remember(detection)
        if self._frame % self._config.learning.update_interval == 0:
            self._detector.train()
            self._scale.learn(view, self._box)
