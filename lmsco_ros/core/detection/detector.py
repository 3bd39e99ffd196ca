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

"""Where the learned filter sees the target: patches, features, score, peak."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lmsco_ros.core.backend import Array, Backend, to_numpy
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.detection.scale import scale_factors, score_slope
from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.features.extractor import FeatureExtractor
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.fourier.localization import locate, Peak, peak_to_sidelobe_ratio, refine
from lmsco_ros.core.fourier.series import grid_size, shift
from lmsco_ros.core.imaging.regions import patch_size, region_around
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.learning.memory import score
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from lmsco_ros.core.networks.together import Asking, at_once, in_step
from lmsco_ros.core.types import BoundingBox
from lmsco_ros.core.weights.loading import Networks

__all__ = ['Detection', 'Detector']


@dataclass(frozen=True)
class Detection:
    """
    Where the filter sees the target in one search region.

    Attributes
    ----------
    region : BoundingBox
        The region at the winning scale.
    peak : Peak
        Maximum of the score.
    sample : list of array, shape (2K_l + 1, K_l + 1, C_l)
        Feature series of the region.
    scores : array, shape (2K + 1, K + 1)
        Series of the score.
    sharpness : float
        Peak-to-sidelobe ratio of the score.

    """

    region: BoundingBox
    peak: Peak
    sample: list[Array]
    scores: Array
    sharpness: float

    @property
    def center(self) -> tuple[float, float]:
        """Center (x, y) of the target in image pixels."""
        return self.image_position(self.peak.displacement)

    def image_position(self, displacement: tuple[float, float]) -> tuple[float, float]:
        """Return the image position (x, y) of a displacement (dy, dx) in periods."""
        x, y = self.region.center
        return x + displacement[1] * self.region.width, y + displacement[0] * self.region.height

    def displacement_to(self, position: tuple[float, float]) -> tuple[float, float]:
        """Return the displacement (dy, dx) in periods of an image position (x, y)."""
        x, y = self.region.center
        return ((position[1] - y) / self.region.height, (position[0] - x) / self.region.width)

    def sample_around(self, center: tuple[float, float]) -> list[Array]:
        """Return the sample with an image position (x, y) at the origin."""
        displacement = self.displacement_to(center)
        return [shift(series, displacement) for series in self.sample]


def _everywhere(places: np.ndarray) -> np.ndarray:
    """Return that every place comes into question."""
    return np.ones(places.shape[:-1], bool)


class Detector:
    """
    Features and filter of one target.

    Parameters
    ----------
    config : TrackerConfig
        How to track.
    backend : Backend
        Where the filter is computed.
    networks : Networks
        Of the feature blocks.
    view : FrameView
        First frame.
    box : BoundingBox
        The target in it.

    Raises
    ------
    ImageError
        When there is nothing to see in the search region.

    """

    def __init__(self, config: TrackerConfig, backend: Backend, networks: Networks,
                 view: FrameView, box: BoundingBox) -> None:
        self._config = config
        self._patch_size = patch_size(box.size, config.sampling, config.cell)
        self._extractor = FeatureExtractor(config, networks, self._patch_size, backend)
        self._motion = MotionObserver(config.motion) if config.sees_motion else None
        self._operator = self._learn_first(view, box, backend)
        self._first_filters = [1 * block for block in self._operator.filters]
        self._scale_slope = 0.0
        self._first_scales: list[Array] = []
        if config.scale.calibrated and len(scale_factors(config.scale)) > 1:
            step = config.scale.step
            self._first_scales = self._extractor(np.stack([
                self._patch(view, region_around(box.scaled(factor), config.sampling))
                for factor in (1 / step, step)]))
            self._calibrate()

    def __call__(self, view: FrameView, box: BoundingBox,
                 factors: Sequence[float] = (1.0,)) -> Detection:
        """
        Search for the target around `box`.

        Parameters
        ----------
        view : FrameView
            A frame.
        box : BoundingBox
            Where the target was, or may be.
        factors : sequence of float
            Scales at which it is searched, relative to the size of `box`.

        """
        return at_once(self.ask(view, box, factors))

    def ask(self, view: FrameView, box: BoundingBox,
            factors: Sequence[float] = (1.0,)) -> Asking[Detection]:
        """Search as `__call__` does, and ask for the passes of the networks."""
        regions = [region_around(box.scaled(factor), self._config.sampling) for factor in factors]
        patches = np.stack([self._patch(view, region) for region in regions])
        samples = yield from self._extractor.ask(
            patches, self._moving(regions, patches, factors))
        yield from in_step()
        scores = self._operator.scores(samples)
        grid = grid_size(int(scores.shape[1]) - 1)
        gains = [factor**-self._scale_slope for factor in factors]
        peak = locate(scores, grid, self._config.sampling.newton_steps, gains)
        best = peak.scale_index
        sharpness = peak_to_sidelobe_ratio(
            peak.grid, round(grid / (2 * self._config.sampling.search_factor)))
        return Detection(regions[best], peak, [block[:, :, best, :] for block in samples],
                         scores[..., best], sharpness)

    def likeness(self, detection: Detection) -> float:
        """Return what the filter of the first frame, which never changes, says of the peak."""
        sample = [block[:, :, None, :] for block in detection.sample]
        series = to_numpy(score(sample, self._first_filters))[..., 0]
        return refine(series, detection.peak.displacement, 0)[1]

    def near(self, detection: Detection, place: tuple[float, float],
             owned: Callable[[np.ndarray], np.ndarray] = _everywhere) -> Detection:
        """
        Return the detection at the highest score within half a target of a place.

        Parameters
        ----------
        detection : Detection
            Another peak of the same score.
        place : tuple of float
            Image position (x, y).
        owned : callable
            Tells which image positions, shape (..., 2), come into question.

        """
        grid = detection.peak.grid
        size = grid.shape[0]
        reach = max(1, round(size / (2 * self._config.sampling.search_factor)))
        middle = [round(t * size) for t in detection.displacement_to(place)]
        around = np.arange(-reach, reach + 1)
        rows, columns = (middle[0] + around) % size, (middle[1] + around) % size
        ty, tx = ((t / size + 0.5) % 1.0 - 0.5 for t in (rows, columns))
        places = np.stack(detection.image_position(np.meshgrid(ty, tx, indexing='ij')), axis=-1)
        square = np.where(owned(places), grid[np.ix_(rows, columns)], -np.inf)
        row, column = np.unravel_index(np.argmax(square), square.shape)
        start, series = (float(ty[row]), float(tx[column])), to_numpy(detection.scores)
        displacement, value = refine(series, start, self._config.sampling.newton_steps)
        if not owned(np.array(detection.image_position(displacement))):
            displacement, value = refine(series, start, 0)
        peak = replace(detection.peak, displacement=displacement, value=value)
        return replace(detection, peak=peak,
                       sharpness=detection.sharpness * value / detection.peak.value)

    def watch(self, view: FrameView, box: BoundingBox) -> None:
        """Take note of where the target is expected next, to see what moves there."""
        if self._motion is not None:
            region = region_around(box, self._config.sampling)
            self._motion.remember(region, self._patch(view, region))

    def remember(self, detection: Detection, center: tuple[float, float]) -> None:
        """
        Take the detection as a further training sample.

        Parameters
        ----------
        detection : Detection
            What was seen.
        center : tuple of float
            Image position (x, y) of the target, which may be known better than by the peak.

        """
        self._operator.remember(detection.sample_around(center))

    def train(self) -> None:
        """Adapt the filter to the samples."""
        self._operator.train()
        if self._first_scales:
            self._calibrate()

    def _learn_first(self, view: FrameView, box: BoundingBox,
                     backend: Backend) -> StructuredOperator:
        """Train the filter on the first frame."""
        region = region_around(box, self._config.sampling)
        patch = self._patch(view, region)
        if float(patch.max() - patch.min()) <= 0:
            raise ImageError('the image is constant around the box; '
                             'expected a target that differs from its background')
        target = (box.height / region.height, box.width / region.width)
        sample = [block[:, :, 0, :] for block in self._extractor(patch[None])]
        return StructuredOperator(self._config.learning, sample, target, backend)

    def _calibrate(self) -> None:
        """See how the score of the first frame's target depends on the scale by now."""
        scores = self._operator.scores(self._first_scales)
        grid = grid_size(int(scores.shape[1]) - 1)
        smaller, larger = locate(
            scores, grid, self._config.sampling.newton_steps).scale_values
        self._scale_slope = score_slope(self._config.scale.step, float(smaller), float(larger))

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
