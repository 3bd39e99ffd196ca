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

from array_api_compat.numpy import vecdot
import numpy as np
import scipy.fft

from lmsco_ros.core.config import ScaleConfig
from lmsco_ros.core.extent.size import credible_change
from lmsco_ros.core.features.hog import hog
from lmsco_ros.core.imaging.view import FrameView
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
    over the scales. Two of them, of which one follows what the target looks like and the other
    holds on to what it was, are averaged: the first alone takes its own errors for the truth.
    The maximum is refined by the parabola through its neighbors.

    Parameters
    ----------
    config : ScaleConfig
        Scales, model size, rates.
    size : tuple of float
        Target (width, height) in the first frame; fixes the shape of the model.

    """

    def __init__(self, config: ScaleConfig, size: tuple[float, float]) -> None:
        self._config = config
        factors = np.array(scale_factors(config))
        offsets = np.arange(config.exponent_min, config.exponent_max + 1)
        label = np.exp(-0.5 * (offsets / config.label_sigma)**2)
        self._label = np.conj(scipy.fft.rfft(label.astype(np.float32)))[:, None]
        self._rates = np.array([config.learning_rate, config.slow_rate], np.float32)[:, None]
        self._shares = np.array([1 - config.slow_share, config.slow_share], np.float32)
        self._learned = False
        self._numerators = np.zeros((2, 1, 1), np.complex64)
        self._denominators = np.zeros((2, 1), np.float32)
        window = np.hanning(len(factors) + 2)[1:-1].astype(np.float32)
        self._transform = scipy.fft.rfft(np.diag(window), axis=0)
        self._model = _model_size(size, config.model_area)
        self._largest = config.padding * float(factors[-1])
        self._pixels = tuple(math.ceil(side * factors[-1]) for side in self._model)
        columns, rows = (
            np.stack([_zoom(length, factor / factors[-1], side) for factor in factors])
            for length, side in zip(self._pixels, self._model, strict=True))
        self._rows, self._columns = rows.reshape(-1, rows.shape[2]), columns.transpose(0, 2, 1)

    def learn(self, view: FrameView, box: BoundingBox) -> None:
        """Average the sample around `box` into the filters."""
        spectrum = self._sample(view, box)
        rates = self._rates if self._learned else np.ones_like(self._rates)
        numerator = spectrum * self._label
        denominator = vecdot(spectrum, spectrum).real / spectrum.shape[1]
        self._numerators = self._numerators + rates[:, None] * (numerator - self._numerators)
        self._denominators = self._denominators + rates * (denominator - self._denominators)
        self._learned = True

    def estimate(self, view: FrameView, box: BoundingBox) -> float:
        """Return the part that is believed of the factor at the maximum of the response."""
        spectrum = self._sample(view, box)
        responses = vecdot(self._numerators, spectrum) / spectrum.shape[1]
        responses /= self._denominators + np.float32(self._config.regularization)
        response = scipy.fft.irfft(self._shares @ responses, len(self._columns))
        factor = _best_factor(self._config, response)
        return credible_change(factor, box, self._config.damping)

    def _sample(self, view: FrameView, box: BoundingBox) -> np.ndarray:
        """Return the spectrum over scale of the windowed features, shape (n // 2 + 1, d)."""
        return self._transform @ self._features(view, box)

    def _features(self, view: FrameView, box: BoundingBox) -> np.ndarray:
        """Return one feature vector per scale: HOG and normalized intensity, shape (n, d)."""
        patches = self._patches(view, box)
        count = len(patches)
        gray = patches.reshape(count, -1)
        gray = gray - gray.mean(axis=1, keepdims=True)
        deviation = np.sqrt(vecdot(gray, gray) / gray.shape[1]) + np.float32(1e-6)
        gray = gray.reshape(patches.shape)[:, ::2, ::2].reshape(count, -1)
        return np.concatenate([hog(patches, _CELL).reshape(count, -1),
                               gray * (np.float32(0.1) / deviation[:, None])], axis=1)

    def _patches(self, view: FrameView, box: BoundingBox) -> np.ndarray:
        """Return the target at every scale, in the size of the model."""
        region = BoundingBox.from_center(
            box.center, (self._largest * box.width, self._largest * box.height))
        rows = self._rows @ view.patch(region, self._pixels)
        return rows.reshape(len(self._columns), self._model[1], -1) @ self._columns


def _model_size(size: tuple[float, float], area: float) -> tuple[int, int]:
    """Return (width, height) of the model: the target's shape, whole cells, at most `area`."""
    factor = math.sqrt(area / (size[0] * size[1]))
    width, height = (max(2 * _CELL, _CELL * round(side * factor / _CELL)) for side in size)
    return width, height


def _zoom(length: int, part: float, size: int) -> np.ndarray:
    """Return the linear interpolation from `length` pixels to `size` in their middle `part`."""
    step = part * length / size
    places = ((1 - part) * length + step - 1) / 2 + step * np.arange(size)
    inside = places.clip(0, length - 1)[:, None]
    return np.maximum(0, 1 - np.abs(inside - np.arange(length))).astype(np.float32)


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
