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
Expected average overlap (EAO) of the VOT challenges, in both conventions.

The curve at N frames is the mean, over the fragments that tell something about N
frames, of the mean overlap in the frames after the start. A fragment that ended in
a failure goes on with overlap 0; one that ended with its sequence says nothing
about longer ones. The score is the mean of the curve over an interval of N.

The two conventions differ in where the curve ends. The MATLAB toolkit, with which
the published tables were made, follows it to the longest sequence; the Python
toolkit to the longest fragment of the very tracker, which leaves out the part where
a weak tracker has long failed, and so overrates it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.supervised import Fragment

# Frames; read off the published curve of VOT-TIR2016, counted from 1 as in MATLAB.
VOT_TIR2016_INTERVAL = (34, 509)


def curve_terms(fragments: Sequence[Fragment], length: int) -> tuple[Array, Array]:
    """
    Return what fragments add to the expected-overlap curve.

    Parameters
    ----------
    fragments : sequence of Fragment
        Stretches of tracking, of one or of many sequences.
    length : int
        Number of frames that the curve covers.

    Returns
    -------
    sums, counts : ndarray, shape (length,)
        Sum of the mean overlaps over the fragments that count at N = 1, 2, ..., and how
        many these are. Terms of several sequences add up; sums / counts is the curve.

    """
    sums, counts = np.zeros(length), np.zeros(length)
    for fragment in fragments:
        padded = np.zeros(length)
        kept = min(len(fragment.overlaps), length)
        padded[:kept] = fragment.overlaps[:kept]
        valid = np.arange(length) < (length if fragment.failed else kept)
        sums += np.where(valid, _running_mean(padded), 0)
        counts += valid
    return sums, counts


def expected_overlap_curve(sums: Array, counts: Array) -> Array:
    """Return the curve, shape (..., length); NaN at lengths that no fragment tells about."""
    return np.divide(sums, counts, out=np.full(np.shape(sums), np.nan), where=counts > 0)


def longest_fragment(fragments: Sequence[Fragment]) -> int:
    """Return the number of frames after which the Python toolkit ends the curve."""
    return max((len(fragment.overlaps) for fragment in fragments), default=0)


def expected_average_overlap(curve: Array, interval: tuple[int, int]) -> Array:
    """
    Return the mean of curves over an interval.

    Parameters
    ----------
    curve : ndarray, shape (..., length)
        Expected overlap at 1, 2, ... frames.
    interval : (int, int)
        First and last number of frames, both included, counted from 1; what lies
        beyond the curve is left out. The VOT toolkit counts from 0 (33, 508).

    Returns
    -------
    ndarray, shape (...)
        NaN where the curve has no value in the interval.

    """
    part = curve[..., interval[0] - 1:interval[1]]
    known = np.isfinite(part)
    total = np.where(known, part, 0).sum(axis=-1)
    count = known.sum(axis=-1)
    return np.divide(total, count, out=np.full(np.shape(total), np.nan), where=count > 0)


def _running_mean(overlaps: Array) -> Array:
    """Mean over the frames after the start; the start itself is no achievement."""
    means = overlaps.copy()
    means[1:] = np.cumsum(overlaps[1:]) / np.arange(1, len(overlaps))
    return means
