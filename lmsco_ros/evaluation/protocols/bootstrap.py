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
Confidence intervals over sequences by the percentile bootstrap.

Frames of one sequence are far from independent, so whole sequences are drawn. The
drawing is seeded: the same results give the same interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array

RESAMPLES = 2000
LEVEL = 0.95
_SEED = 20160817


@dataclass(frozen=True)
class Estimate:
    """A figure and the interval that holds it at the level `LEVEL`; NaN without data."""

    value: float
    low: float
    high: float


def resampled_weights(sequences: int, resamples: int = RESAMPLES) -> Array:
    """
    Return how often each sequence is drawn in each resample.

    Returns
    -------
    ndarray, shape (resamples, sequences)
        Counts that sum to `sequences` in each row.

    """
    generator = np.random.default_rng(_SEED)
    chances = np.full(sequences, 1 / sequences)
    return generator.multinomial(sequences, chances, size=resamples).astype(float)


def estimate(statistic: Callable[[Array], Array], sequences: int,
             resamples: int = RESAMPLES) -> Estimate:
    """
    Return a statistic with its interval.

    Parameters
    ----------
    statistic : callable
        Maps weights of the sequences, shape (..., sequences), to values, shape (...).
    sequences : int
        Number of sequences; without any the estimate is NaN.
    resamples : int, default 2000
        Number of bootstrap resamples.

    """
    if sequences == 0:
        return Estimate(float('nan'), float('nan'), float('nan'))
    value = float(statistic(np.ones(sequences)))
    drawn = statistic(resampled_weights(sequences, resamples))
    drawn = drawn[np.isfinite(drawn)]
    if not drawn.size:
        return Estimate(value, float('nan'), float('nan'))
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Estimate(value, float(low), float(high))


def ratio_estimate(numerators: Array, denominators: Array) -> Estimate:
    """
    Return sum(numerators) / sum(denominators) over sequences with its interval.

    Parameters
    ----------
    numerators, denominators : ndarray, shape (sequences,)
        One pair a sequence, such as frames and seconds.

    """
    def statistic(weights: Array) -> Array:
        bottom = weights @ denominators
        return np.divide(weights @ numerators, bottom,
                         out=np.full(np.shape(bottom), np.nan), where=bottom > 0)
    return estimate(statistic, len(numerators))


def mean_estimate(values: Array) -> Estimate:
    """Return the mean of one value a sequence with its interval; NaN values are left out."""
    known = values[np.isfinite(values)]
    return ratio_estimate(known, np.ones(len(known)))


def paired_difference(first: Array, second: Array) -> Estimate:
    """
    Return the mean of `first` - `second` with its interval.

    Parameters
    ----------
    first, second : ndarray, shape (sequences,)
        Figures of two trackers on the same sequences, in the same order. The difference
        is real at the level of the interval when this does not hold 0.

    """
    return mean_estimate(first - second)
