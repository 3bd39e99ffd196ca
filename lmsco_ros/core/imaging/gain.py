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

"""From sensor counts to a working range that does not flicker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.errors import ImageError
from lmsco_ros.core.imaging.sampled import (
    credible_values, noise_deviation, percentiles, take_probe)
from lmsco_ros.core.imaging.scene_change import same_picture, scene_pattern, SceneMonitor

__all__ = ['AutomaticGain', 'FrameCondition', 'FrameSurvey', 'IntensityRange', 'survey']

# Below this the inverse of a range is no number any more.
_NARROWEST = 1e-30

# Where most of a scene lies, and how many times that far away its pixels get suspicious.
_MOST = (10.0, 90.0)
_FAR = 4.0


@dataclass(frozen=True)
class IntensityRange:
    """
    Counts that become 0 and 1.

    Attributes
    ----------
    low, high : float
        Counts, not the same; low > high turns warm and cold around.

    """

    low: float
    high: float

    def normalize(self, counts: np.ndarray) -> np.ndarray:
        """Return float32 counts in the working range, not clipped."""
        scale = np.float32(1 / (self.high - self.low))
        return (counts - np.float32(self.low)) * scale

    def turned(self) -> IntensityRange:
        """Return the range with warm and cold in each other's place."""
        return IntensityRange(self.high, self.low)


@dataclass(frozen=True, eq=False)
class FrameSurvey:
    """
    A frame with all that can be said of it without the frames before: once for all targets.

    Attributes
    ----------
    image : ndarray
        The frame, as `read_frame` returns it; not copied.
    probe : ndarray, shape (h, w)
        A regular subset of its pixels.
    pattern : ndarray or None
        What of the scene is compared with other frames; None when it shows nothing.
    upright, mirrored : IntensityRange
        Percentiles of its counts, counted from below and from above.
    noise : float
        Standard deviation of its noise in counts.

    """

    image: np.ndarray
    probe: np.ndarray
    pattern: np.ndarray | None
    upright: IntensityRange
    mirrored: IntensityRange
    noise: float = 0.0


def survey(image: np.ndarray, config: IntensityConfig) -> FrameSurvey:
    """
    Measure a frame on a regular subset of its pixels.

    Parameters
    ----------
    image : ndarray
        As `read_frame` returns it; pixels without a finite value do not count.
    config : IntensityConfig
        Percentiles.

    Raises
    ------
    ImageError
        When no pixel is finite.

    """
    probe = take_probe(image)
    upright, mirrored = _measure(image, probe, config)
    pattern = scene_pattern(probe, upright.low, upright.high)
    return FrameSurvey(image, probe, pattern, upright, mirrored, noise_deviation(image))


@dataclass(frozen=True)
class FrameCondition:
    """
    What a frame is like before anything is looked for in it.

    Attributes
    ----------
    intensity : IntensityRange
        Working range; warm and cold are as in the first frame, whatever the polarity.
    shutter_closed : bool
        Whether the frame is the one before once more, bit for bit: the shutter is closed for
        a flat-field correction, or the source repeats itself. It shows nothing new.
    inverted : bool
        Whether the polarity (white hot, black hot) is not the one of the first frame.
    cut : bool
        Whether it shows another view than the frame before.
    noise : float
        Standard deviation of its noise in the working range.

    """

    intensity: IntensityRange
    shutter_closed: bool
    inverted: bool
    cut: bool
    noise: float = 0.0


class AutomaticGain:
    """
    Follows the percentiles of the frames.

    Small changes are smoothed, so that a warm object at the border does not make the picture
    flicker; a change above `jump`, as a camera's own gain control makes it, is adopted at once.
    Both rules are relative to the range: a constant gain and offset of the camera change
    nothing, and neither does a switch of its polarity after the first frame.

    Parameters
    ----------
    config : IntensityConfig
        Percentiles and rates.

    """

    def __init__(self, config: IntensityConfig) -> None:
        self._config = config
        self._scene = SceneMonitor()
        self._probe: np.ndarray | None = None
        self._range: IntensityRange | None = None

    def observe(self, image: np.ndarray) -> IntensityRange:
        """Return the range for this frame, seen on a regular subset of its pixels."""
        return self.examine(survey(image, self._config)).intensity

    def examine(self, frame: FrameSurvey) -> FrameCondition:
        """Take note of a frame and return what it is like."""
        change = self._scene.observe(frame.pattern)
        inverted = self._scene.inverted
        self._range = self._follow(frame.mirrored if inverted else frame.upright,
                                   at_once=change.switched or change.cut)
        closed = self._probe is not None and same_picture(self._probe, frame.probe)
        self._probe = frame.probe
        noise = frame.noise / abs(self._range.high - self._range.low)
        return FrameCondition(self._range.turned() if inverted else self._range, closed, inverted,
                              change.cut, noise)

    def _follow(self, measured: IntensityRange, at_once: bool) -> IntensityRange:
        """Return the range after one more frame."""
        if self._range is None or at_once or self._jumped(measured):
            return measured
        rate = self._config.smoothing
        return IntensityRange(self._range.low + rate * (measured.low - self._range.low),
                              self._range.high + rate * (measured.high - self._range.high))

    def _jumped(self, measured: IntensityRange) -> bool:
        """Return whether the range has changed by more than a smooth scene explains."""
        assert self._range is not None
        change = max(abs(measured.low - self._range.low), abs(measured.high - self._range.high))
        return change > self._config.jump * (self._range.high - self._range.low)


def _measure(image: np.ndarray, probe: np.ndarray,
             config: IntensityConfig) -> tuple[IntensityRange, IntensityRange]:
    """Return the percentiles of a frame, counted from below and from above."""
    values = probe[np.isfinite(probe)] if probe.dtype == np.float32 else probe.ravel()
    if values.size == 0:
        raise ImageError('the image has no finite pixel; expected counts or temperatures')
    low, high = config.low_percentile, config.high_percentile
    shares = (low, high, 100 - high, 100 - low)
    start, *ends, end = percentiles(values, (_MOST[0], *shares, _MOST[1]))
    if max(start - min(ends), max(ends) - end) > _FAR * (end - start):
        credible = credible_values(image, probe, end - start)
        if credible.size and credible.max() > credible.min():
            values, ends = credible, percentiles(credible, shares)
    return _range(values, *ends[:2]), _range(values, *ends[2:])


def _range(values: np.ndarray, low: float, high: float) -> IntensityRange:
    """Return the range from `low` to `high`, wider where these are the same."""
    if high - low <= _NARROWEST:
        low, high = float(values.min()), float(values.max())
    return IntensityRange(low, high if high - low > _NARROWEST else low + 1.0)
