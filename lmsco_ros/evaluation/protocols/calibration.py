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

"""Whether a score is the probability that it is said to be: reliability and its error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.confidence import GOOD_OVERLAP

BINS = 10


@dataclass(frozen=True, eq=False)
class CalibrationTerms:
    """
    What the calibration over any choice of sequences is made of.

    Attributes
    ----------
    counts : ndarray, shape (sequences, BINS)
        Frames whose score is in each of `BINS` equal parts of [0, 1].
    scores, good : ndarray, shape (sequences, BINS)
        Sum of their scores, and how many of them are good.

    """

    counts: Array
    scores: Array
    good: Array

    @property
    def frames(self) -> Array:
        """Frames in each bin over all sequences, shape (BINS,)."""
        return self.counts.sum(axis=0)

    @property
    def mean_scores(self) -> Array:
        """Mean score in each bin, shape (BINS,); NaN in an empty one."""
        return _ratio(self.scores.sum(axis=0), self.frames)

    @property
    def shares(self) -> Array:
        """Share of good frames in each bin, shape (BINS,); NaN in an empty one."""
        return _ratio(self.good.sum(axis=0), self.frames)


def calibration_terms(scores: Sequence[Array], overlap: Sequence[Array]) -> CalibrationTerms:
    """
    Return the sums over the frames of each sequence that have a score.

    Parameters
    ----------
    scores : sequence of ndarray
        For each sequence, the tracker's score for each frame; NaN where it gave none. Scores
        beyond [0, 1] are no probabilities, and then none counts.
    overlap : sequence of ndarray
        Overlap for each frame; good is above 0.5, and not NaN, where the target is absent.

    """
    counts, sums, goods = (np.zeros((len(scores), BINS)) for _ in range(3))
    given = [score[np.isfinite(score)] for score in scores]
    if any(((values < 0) | (values > 1)).any() for values in given):
        return CalibrationTerms(counts, sums, goods)
    for row, (score, values) in enumerate(zip(scores, overlap, strict=True)):
        known = np.isfinite(score)
        bins = np.minimum((BINS * score[known]).astype(int), BINS - 1)
        counts[row] = np.bincount(bins, minlength=BINS)
        sums[row] = np.bincount(bins, score[known], BINS)
        goods[row] = np.bincount(bins, (values[known] > GOOD_OVERLAP).astype(float), BINS)
    return CalibrationTerms(counts, sums, goods)


def calibration_error(terms: CalibrationTerms, weights: Array) -> Array:
    """
    Return the expected calibration error.

    The mean distance, over frames, between the mean score of a bin and its share of good frames
    (Naeini et al., AAAI 2015).

    Parameters
    ----------
    terms : CalibrationTerms
        Sums over frames.
    weights : ndarray, shape (..., sequences)
        How often each sequence counts.

    Returns
    -------
    ndarray, shape (...)
        In [0, 1]; NaN without scores.

    """
    gaps = np.abs(weights @ (terms.scores - terms.good)).sum(axis=-1)
    return _ratio(gaps, weights @ terms.counts.sum(axis=1))


def _ratio(top: Array, bottom: Array) -> Array:
    return np.divide(top, bottom, out=np.full(np.shape(bottom), np.nan), where=bottom > 0)
