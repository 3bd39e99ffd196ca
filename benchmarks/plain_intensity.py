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

"""
The default tracker without what it does about the intensities of a thermal camera.

For `lmsco evaluate`, beside `--tracker default`:
`--tracker python:benchmarks.plain_intensity:min_max` stretches each frame from its lowest to
its highest number, as a viewer does; `python:benchmarks.plain_intensity:first_range` keeps the
range of the first frame. Neither knows of a closed shutter or of a switched polarity.
"""

from __future__ import annotations

from collections.abc import Callable
from unittest.mock import patch

import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, track, TrackerConfig
from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.imaging.gain import AutomaticGain, FrameCondition, FrameSurvey, IntensityRange
from lmsco_ros.evaluation.trackers.configured import ConfiguredTracker

__all__ = ['first_range', 'min_max']


class _MinMax:
    """Stretches each frame over its own numbers."""

    def __init__(self, config: IntensityConfig) -> None:
        """Take the configuration, of which nothing is used."""

    def examine(self, frame: FrameSurvey) -> FrameCondition:
        """Return the range of all numbers of a frame."""
        image = frame.image
        values = image[np.isfinite(image)] if image.dtype.kind == 'f' else image
        low, high = float(values.min()), float(values.max())
        return FrameCondition(IntensityRange(low, max(high, low + 1)), False, False, False)


class _FirstRange:
    """Keeps the range of the first frame."""

    def __init__(self, config: IntensityConfig) -> None:
        self._gain = AutomaticGain(config)
        self._range: IntensityRange | None = None

    def examine(self, frame: FrameSurvey) -> FrameCondition:
        """Return the range of the first frame."""
        self._range = self._range or self._gain.examine(frame).intensity
        return FrameCondition(self._range, False, False, False)


class _PlainTracker(ConfiguredTracker):
    """The default tracker with another gain; only its own tracks are made with it."""

    def __init__(self, gain: Callable[[IntensityConfig], _MinMax | _FirstRange]) -> None:
        super().__init__(TrackerConfig.preset('default'))
        self._gain = gain

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start on `box`."""
        with patch.object(track, 'AutomaticGain', self._gain):
            super().initialize(image, box)


def min_max() -> ConfiguredTracker:
    """Return the tracker that stretches each frame from its lowest to its highest number."""
    return _PlainTracker(_MinMax)


def first_range() -> ConfiguredTracker:
    """Return the tracker that keeps the range of the first frame."""
    return _PlainTracker(_FirstRange)
