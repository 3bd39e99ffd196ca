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

"""Ranks of trackers by accuracy and by robustness, as in the A-R ranking plot."""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata

from lmsco_ros.evaluation.geometry import Array


def mean_ranks(values: Array, higher_is_better: bool) -> Array:
    """
    Return the mean rank of each tracker over the sequences.

    Parameters
    ----------
    values : ndarray, shape (trackers, sequences)
        One figure for each tracker and sequence.
    higher_is_better : bool
        True for accuracy, False for failures.

    Returns
    -------
    ndarray, shape (trackers,)
        1 is best; equal figures share the mean of their ranks.

    """
    ordered = np.where(higher_is_better, -values, values)
    return rankdata(ordered, method='average', axis=0).mean(axis=1)
