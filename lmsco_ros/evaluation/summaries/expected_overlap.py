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

"""Expected overlap of one tracker over whole sequences, with its interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, estimate
from lmsco_ros.evaluation.protocols.expected_overlap import (
    curve_terms, expected_average_overlap, expected_overlap_curve)
from lmsco_ros.evaluation.protocols.supervised import Fragment


def curve_and_eao(fragments: Sequence[Sequence[Fragment]], length: int,
                  interval: tuple[int, int]) -> tuple[Array, Estimate]:
    """
    Return the expected-overlap curve and its mean over an interval of lengths.

    Parameters
    ----------
    fragments : sequence of sequence of Fragment
        The stretches of tracking of each whole sequence.
    length : int
        Number of frames that the curve covers.
    interval : (int, int)
        First and last number of frames that count for the mean.

    Returns
    -------
    curve : ndarray, shape (length,)
        NaN at lengths that no fragment tells about.
    eao : Estimate
        The mean, with its interval over sequences.

    """
    terms = [curve_terms(parts, length) for parts in fragments]
    sums, counts = (np.array(kind) for kind in zip(*terms))

    def score(weights: Array) -> Array:
        curve = expected_overlap_curve(weights @ sums, weights @ counts)
        return expected_average_overlap(curve, interval)

    return (expected_overlap_curve(sums.sum(axis=0), counts.sum(axis=0)),
            estimate(score, len(fragments)))
