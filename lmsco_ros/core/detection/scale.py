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

"""The scale at which the target is found, of those that are searched (paper, section III-B)."""

from __future__ import annotations

import math

import numpy as np

from lmsco_ros.core.config import ScaleConfig

__all__ = ['found_factor', 'scale_factors', 'score_slope']

# Of the other score; the logarithm of what is less says nothing of the scale.
_LEAST_SHARE = 0.01


def scale_factors(config: ScaleConfig) -> tuple[float, ...]:
    """Return step^n for the configured exponents, growing."""
    return tuple(config.step**n for n in range(config.exponent_min, config.exponent_max + 1))


def score_slope(step: float, smaller: float, larger: float) -> float:
    """
    Return d log(score) / d log(factor) at the size in which a filter was trained.

    The score falls off to both sides of that size, but is not highest there: with the size of the
    region the target and its surroundings change their shares. Scores times factor^-slope are
    highest at the right size.

    Parameters
    ----------
    step : float
        Ratio of two neighboring scales.
    smaller, larger : float
        Scores of the same target one scale below and one above its size.

    """
    least = _LEAST_SHARE * max(smaller, larger, _LEAST_SHARE)
    return math.log(max(larger, least) / max(smaller, least)) / (2 * math.log(step))


def found_factor(config: ScaleConfig, values: np.ndarray) -> float:
    """
    Return the scale that the size follows to, part of the way to that of the target.

    That is refined between the scales that were searched. What is wrong with it is learned with
    the sample and becomes the next frame's size: in part of the way there is as much less of it.

    Parameters
    ----------
    config : ScaleConfig
        The scales.
    values : ndarray, shape (n,)
        Best score at each, calibrated; one, of a search at the last size, says nothing of it.

    """
    if len(values) == 1:
        return 1.0
    best = int(np.argmax(values))
    exponent = config.exponent_min + best + _parabola_offset(values, best)
    return float(config.step**(config.rate * exponent))


def _parabola_offset(values: np.ndarray, best: int) -> float:
    """Return where, in [-1/2, 1/2], the parabola through a maximum and its neighbors peaks."""
    if best in (0, len(values) - 1):
        return 0.0
    left, middle, right = (float(v) for v in values[best - 1:best + 2])
    curvature = left - 2 * middle + right
    return 0.0 if curvature >= 0 else 0.5 * (left - right) / curvature
