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

"""Paired differences between trackers, sequence by sequence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, paired_difference

# The peer that everything is compared with where it took part.
_USUAL_REFERENCE = 'csrt'
FEWEST_SEQUENCES = 6


@dataclass(frozen=True)
class Difference:
    """
    One tracker against another.

    Attributes
    ----------
    tracker, reference : str
        Names.
    difference : Estimate
        Mean of `tracker` - `reference` over sequences.
    sequences, better, worse : int
        Number of sequences that both have a figure of, and on how many of them `tracker` was
        better or worse.

    """

    tracker: str
    reference: str
    difference: Estimate
    sequences: int
    better: int
    worse: int

    @property
    def real(self) -> bool:
        """Whether the interval leaves out zero, and enough sequences stand behind it."""
        interval = self.difference
        return enough_sequences(self.sequences) and (interval.low > 0 or interval.high < 0)


def enough_sequences(sequences: int) -> bool:
    """
    Return whether so many sequences can tell trackers apart at all.

    With fewer than six even a sign test on results that all point one way stays above
    the 5 % level, and a bootstrap interval shows no more than the spread.
    """
    return sequences >= FEWEST_SEQUENCES


def reference_of(trackers: tuple[str, ...]) -> str | None:
    """Return the tracker that the others are compared with, None where there is one only."""
    if len(trackers) < 2:
        return None
    return _USUAL_REFERENCE if _USUAL_REFERENCE in trackers else trackers[0]


def differences(figures: Mapping[str, Array],
                higher_is_better: bool) -> tuple[Difference, ...]:
    """
    Return the difference of each tracker to the reference.

    Parameters
    ----------
    figures : mapping of str to ndarray, shape (sequences,)
        One figure a sequence for each tracker.
    higher_is_better : bool
        Decides what counts as a sequence won.

    """
    reference = reference_of(tuple(figures))
    if reference is None:
        return ()
    result = []
    for name, values in figures.items():
        if name != reference:
            margin = values - figures[reference]
            gain = margin if higher_is_better else -margin
            result.append(Difference(
                name, reference, paired_difference(values, figures[reference]),
                sequences=int(np.isfinite(margin).sum()), better=int((gain > 0).sum()),
                worse=int((gain < 0).sum())))
    return tuple(result)
