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

"""Size of the target: search over scaled patches (the paper) or a scale filter (DSST)."""

from __future__ import annotations

import math
from typing import Protocol

import cv2
import numpy as np
import scipy.fft

from lmsco_ros.core.config import ScaleConfig
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.sampling import FrameView
from lmsco_ros.core.types import BoundingBox

__all__ = ['FixedScale', 'ScaleEstimator', 'ScaleFilter', 'ScaleSearch', 'make_scale_estimator',
           'scale_factors']

_CELL = 4


class ScaleEstimator(Protocol):
    """
    How a tracker follows the size of its target.

    Attributes
    ----------
    search_factors : tuple of float
        Scales, relative to the last one, at which the target is searched.

    """

    search_factors: tuple[float, ...]

    def found_factor(self, values: np.ndarray) -> float:
        """Return the scale of the target, given the best score at each scale searched."""

    def learn(self, view: FrameView, box: BoundingBox) -> None:
        """Learn what the target at `box` looks like at its neighboring scales."""

    def estimate(self, view: FrameView, box: BoundingBox) -> float:
        """Return the factor by which the target differs in size from `box`, given its center."""


def scale_factors(config: ScaleConfig) -> tuple[float, ...]:
    """Return step^n for the configured exponents, growing."""
    return tuple(config.step**n for n in range(config.exponent_min, config.exponent_max + 1))


class FixedScale:
    """Constant size."""

    search_factors: tuple[float, ...] = (1.0,)

    def found_factor(self, values: np.ndarray) -> float:
        """Return 1."""
        return 1.0

    def learn(self, view: FrameView, box: BoundingBox) -> None:
        """Learn nothing."""

    def estimate(self, view: FrameView, box: BoundingBox) -> float:
        """Return 1."""
        return 1.0


class ScaleSearch(FixedScale):
    """
    Search over scaled patches (paper, end of section III-B), refined between the scales.

    Parameters
    ----------
    config : ScaleConfig
        The scales.

    """

    def __init__(self, config: ScaleConfig) -> None:
        self._config = config
        self.search_factors = scale_factors(config)

    def found_factor(self, values: np.ndarray) -> float:
        """
        Return the scale at the maximum of the parabola through the best scores.

        One score, of a search at the last size, says nothing of the scale.
        """
        return _best_factor(self._config, values) if len(values) > 1 else 1.0


class ScaleFilter(FixedScale):
    """
    One-dimensional correlation filter over scale (Danelljan et al., DSST, BMVC 2014).

    A sample is one feature vector per scale; the filter is a ridge regression of a Gaussian
    over the scales, solved per frequency and averaged over time. The maximum is refined by the
    parabola through its neighbors.

    Parameters
    ----------
    config : ScaleConfig
        Scales, model size, rates.
    size : tuple of float
        Target (width, height) in the first frame; fixes the shape of the model.

    """

    def __init__(self, config: ScaleConfig, size: tuple[float, float]) -> None:
        self._config = config
        self._factors = np.array(scale_factors(config))
        count = len(self._factors)
        offsets = np.arange(config.exponent_min, config.exponent_max + 1)
        label = np.exp(-0.5 * (offsets / config.label_sigma)**2)
        self._label = scipy.fft.rfft(label.astype(np.float32))
        self._window = np.hanning(count + 2)[1:-1].astype(np.float32)
        self._model = _model_size(size, config.model_area)
        self._learned = False
        self._numerator = np.zeros(1, np.complex64)
        self._denominator = np.zeros(1, np.float32)

    def learn(self, view: FrameView, box: BoundingBox) -> None:
        """Average the sample around `box` into the filter."""
        spectrum = self._sample(view, box)
        numerator = np.conj(spectrum) * self._label[:, None]
        denominator = np.mean(np.abs(spectrum)**2, axis=1)
        rate = np.float32(self._config.learning_rate if self._learned else 1.0)
        self._numerator = self._numerator + rate * (numerator - self._numerator)
        self._denominator = self._denominator + rate * (denominator - self._denominator)
        self._learned = True

    def estimate(self, view: FrameView, box: BoundingBox) -> float:
        """Return the factor at the maximum of the response."""
        spectrum = self._sample(view, box)
        response = np.mean(self._numerator * spectrum, axis=1)
        response /= self._denominator + np.float32(self._config.regularization)
        return _best_factor(self._config, scipy.fft.irfft(response, len(self._factors)))

    def _sample(self, view: FrameView, box: BoundingBox) -> np.ndarray:
        """Return the spectrum over scale of the features, shape (n // 2 + 1, d)."""
        features = self._features(view, box)
        return scipy.fft.rfft(features * self._window[:, None], axis=0)

    def _features(self, view: FrameView, box: BoundingBox) -> np.ndarray:
        """Return one feature vector per scale: HOG and normalized intensity, shape (n, d)."""
        largest = self._config.padding * float(self._factors[-1])
        width, height = (math.ceil(side * self._factors[-1]) for side in self._model)
        region = BoundingBox.from_center(box.center, (largest * box.width, largest * box.height))
        pixels = view.patch(region, (width, height))
        patches = np.stack([_zoom(pixels, float(factor / self._factors[-1]), self._model)
                            for factor in self._factors])
        gray = patches - patches.mean(axis=(1, 2), keepdims=True)
        gray /= np.sqrt((gray**2).mean(axis=(1, 2), keepdims=True)) + np.float32(1e-6)
        count = len(patches)
        return np.concatenate([hog(patches, _CELL).reshape(count, -1),
                               0.1 * gray[:, ::2, ::2].reshape(count, -1)], axis=1)


def _model_size(size: tuple[float, float], area: float) -> tuple[int, int]:
    """Return (width, height) of the model: the target's shape, whole cells, at most `area`."""
    factor = math.sqrt(area / (size[0] * size[1]))
    width, height = (max(2 * _CELL, _CELL * round(side * factor / _CELL)) for side in size)
    return width, height


def _zoom(pixels: np.ndarray, part: float, size: tuple[int, int]) -> np.ndarray:
    """Return the middle `part` of the pixels, resampled to `size` (width, height)."""
    step = part * pixels.shape[1] / size[0], part * pixels.shape[0] / size[1]
    start = ((1 - part) * pixels.shape[1] + step[0] - 1) / 2, (
        (1 - part) * pixels.shape[0] + step[1] - 1) / 2
    inverse = np.array([[step[0], 0, start[0]], [0, step[1], start[1]]])
    return cv2.warpAffine(pixels, inverse, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                          borderMode=cv2.BORDER_REPLICATE)


def _best_factor(config: ScaleConfig, values: np.ndarray) -> float:
    """Return the factor at the maximum of `values`, one per scale, refined between the scales."""
    best = int(np.argmax(values))
    return float(config.step**(config.exponent_min + best + _parabola_offset(values, best)))


def _parabola_offset(values: np.ndarray, best: int) -> float:
    """Return where, in [-1/2, 1/2], the parabola through a maximum and its neighbors peaks."""
    if best in (0, len(values) - 1):
        return 0.0
    left, middle, right = (float(v) for v in values[best - 1:best + 2])
    curvature = left - 2 * middle + right
    return 0.0 if curvature >= 0 else 0.5 * (left - right) / curvature


def make_scale_estimator(config: ScaleConfig, size: tuple[float, float]) -> ScaleEstimator:
    """Return the configured estimator for a target of `size` (width, height)."""
    if config.estimator == 'filter':
        return ScaleFilter(config, size)
    return ScaleSearch(config) if config.estimator == 'search' else FixedScale()
