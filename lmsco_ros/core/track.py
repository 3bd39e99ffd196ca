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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lmsco_ros.core.backend import Array, Backend
from lmsco_ros.core.confidence import ConfidenceMonitor, peak_to_sidelobe_ratio
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.features.extractor import FeatureExtractor
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.fourier.localization import centered_map, locate, Peak
from lmsco_ros.core.fourier.series import grid_size, shift
from lmsco_ros.core.intensity import AutomaticGain
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from lmsco_ros.core.registration import Registration
from lmsco_ros.core.sampling import (
    check_box, clamp_box, FrameView, patch_size, region_around, search_tiles)
from lmsco_ros.core.scale import make_scale_estimator
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState

__all__ = ['Track']


@dataclass(frozen=True)
class Detection:
    """
    Where the filter sees the target in one search region.

    Attributes
    ----------
    region : BoundingBox
        The region at the winning scale.
    scale : float
        Size of the target, relative to the box that was searched for.
    peak : Peak
        Maximum of the score.
    sample : list of array, shape (2K_l + 1, K_l + 1, C_l)
        Feature series of the region.
    sharpness : float
        Peak-to-sidelobe ratio of the score.

    """

    region: BoundingBox
    scale: float
    peak: Peak
    sample: list[Array]
    sharpness: float

    @property
    def center(self) -> tuple[float, float]:
        """Center (x, y) of the target in image pixels."""
        dy, dx = self.peak.displacement
        x, y = self.region.center
        return x + dx * self.region.width, y + dy * self.region.height

    def recentered_sample(self) -> list[Array]:
        """Return the sample with the target at the origin."""
        return [shift(series, self.peak.displacement) for series in self.sample]


class Track:
    """
    State of one target: where it is, how large, and what was learned of it.

    Parameters
    ----------
    config : TrackerConfig
        How to track.
    backend : Backend
        Where the filter is computed.
    networks : mapping of str to Backbone
        Networks of the feature blocks.
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

    def __init__(self, config: TrackerConfig, backend: Backend, networks: Mapping[str, object],
                 image: np.ndarray, box: BoundingBox) -> None:
        self.image_shape, self.image_type = image.shape, image.dtype
        check_box(box, (image.shape[1], image.shape[0]))
        self._config = config
        self._box = box
        self._frame = 0
        self._tile = 0
        self._gain = AutomaticGain(config.intensity)
        self._monitor = ConfidenceMonitor(config.confidence)
        self._patch_size = patch_size(box.size, config.sampling, config.cell)
        self._extractor = FeatureExtractor(config, networks, self._patch_size, backend)
        self._motion = MotionObserver(config.motion) if 'motion' in networks else None
        view = FrameView(image, self._gain.observe(image))
        self._operator = self._learn_first(view, backend)
        self._scale = make_scale_estimator(config.scale, box.size)
        self._scale.learn(view, box)
        self._registration = Registration(
            config.registration, networks['registration'], view, box) if (
            'registration' in networks) else None
        self._first = self._detect(view, box)
        self._watch(view)

    def first_result(self) -> TrackResult:
        """Return the result of the first frame: the given box."""
        return self._result(self._first, 1.0, TrackState.TRACKING)

    def advance(self, image: np.ndarray) -> TrackResult:
        """Find the target in the next frame, and learn from it if it can be trusted."""
        self._frame += 1
        view = FrameView(image, self._gain.observe(image))
        detection = self._detect(view, self._box)
        if not self._monitor.believable(detection.sharpness):
            detection = self._search_elsewhere(view, detection)
        believed = self._monitor.believable(detection.sharpness)
        state = self._monitor.judge(detection.sharpness)
        if believed:
            self._follow(view, detection)
            self._learn(view, detection)
        self._watch(view)
        return self._result(detection, self._monitor.score(detection.sharpness), state)

    def _result(self, detection: Detection, score: float, state: TrackState) -> TrackResult:
        """Return what there is to say; the target in the first frame scores 1 in the map."""
        confidence_map = centered_map(detection.peak.grid / self._first.peak.value)
        return TrackResult(self._box, score, state, confidence_map, detection.region)

    def _learn_first(self, view: FrameView, backend: Backend) -> StructuredOperator:
        """Train the filter on the first frame."""
        region = region_around(self._box, self._config.sampling)
        patch = self._patch(view, region)
        if float(patch.max() - patch.min()) <= 0:
            raise ImageError('the image is constant around the box; '
                             'expected a target that differs from its background')
        target = (self._box.height / region.height, self._box.width / region.width)
        sample = [block[:, :, 0, :] for block in self._extractor(patch[None])]
        return StructuredOperator(self._config.learning, sample, target, backend)

    def _detect(self, view: FrameView, box: BoundingBox) -> Detection:
        """Search for the target around `box`, at all scales of the scale estimator."""
        factors = self._scale.search_factors
        regions = [region_around(box.scaled(factor), self._config.sampling) for factor in factors]
        patches = np.stack([self._patch(view, region) for region in regions])
        samples = self._extractor(patches, self._moving(regions, patches, factors))
        scores = self._operator.scores(samples)
        grid = grid_size(int(scores.shape[1]) - 1)
        peak = locate(scores, grid, self._config.newton_steps)
        best = peak.scale_index
        sharpness = peak_to_sidelobe_ratio(
            peak.grid, round(grid / (2 * self._config.sampling.search_factor)))
        return Detection(regions[best], self._scale.found_factor(peak.scale_values), peak,
                         [block[:, :, best, :] for block in samples], sharpness)

    def _patch(self, view: FrameView, region: BoundingBox) -> np.ndarray:
        """Return the patch of a search region."""
        return view.patch(region, (self._patch_size,) * 2)

    def _moving(self, regions: Sequence[BoundingBox], patches: np.ndarray,
                factors: Sequence[float]) -> np.ndarray | None:
        """Return the flow images of the regions, or None where there is nothing to see."""
        if self._motion is None:
            return None
        unscaled = factors.index(1.0)
        return self._motion.images(regions[unscaled], patches[unscaled], factors)

    def _watch(self, view: FrameView) -> None:
        """Take note of where the target is expected next, to see what moves there."""
        if self._motion is not None:
            region = region_around(self._box, self._config.sampling)
            self._motion.remember(region, self._patch(view, region))

    def _search_elsewhere(self, view: FrameView, here: Detection) -> Detection:
        """Return a convincing detection in the next tiles of the image, or `here`."""
        settings = self._config.confidence
        tiles = search_tiles(view.size, here.region.width, self._box.center)
        chosen = [tiles[(self._tile + i) % len(tiles)]
                  for i in range(min(settings.tiles, len(tiles)))]
        self._tile += len(chosen)
        if not chosen:
            return here
        best = max((self._detect(view, self._box.moved_to(center)) for center in chosen),
                   key=lambda detection: detection.sharpness)
        # The window of a tile dims what lies off its center: look again from there.
        best = self._detect(view, self._box.moved_to(best.center))
        return best if self._monitor.quality(best.sharpness) >= settings.found else here

    def _follow(self, view: FrameView, detection: Detection) -> None:
        """Move the box to the detection and adapt its size."""
        self._tile = 0
        moved = self._box.moved_to(detection.center).scaled(detection.scale)
        moved = clamp_box(moved, view.size)
        moved = moved.scaled(self._scale.estimate(view, moved))
        if self._registration is not None:
            moved = self._registration(view, moved).box
        self._box = clamp_box(moved, view.size)

    def _learn(self, view: FrameView, detection: Detection) -> None:
        """Store the sample; when it is time, train the filter and the scale estimator."""
        self._operator.remember(detection.recentered_sample())
        if self._frame % self._config.learning.update_interval == 0:
            self._operator.train()
            self._scale.learn(view, self._box)
