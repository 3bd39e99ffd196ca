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

"""The span of counts that the images of a sequence use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets import TrackingSequence


@dataclass(frozen=True)
class Span:
    """
    The counts between which a sequence lies.

    Attributes
    ----------
    low, high : float
        All there are for 8 bit; else the 1st and 99th percentile of the first image.

    """

    low: float
    high: float

    @classmethod
    def of(cls, sequence: TrackingSequence) -> Span:
        """Return the span of a sequence."""
        first = sequence.frames[0]
        if first.dtype == np.uint8:
            return cls(0.0, 255.0)
        low, high = np.percentile(first[np.isfinite(first)], (1, 99))
        return cls(float(low), float(max(high, low + 1)))

    @property
    def middle(self) -> float:
        """Counts in the middle."""
        return (self.low + self.high) / 2

    @property
    def width(self) -> float:
        """Counts from low to high."""
        return self.high - self.low


def stored(values: npt.NDArray, dtype: npt.DTypeLike) -> npt.NDArray:
    """Return values as an image of type `dtype`; integers are rounded and cut to their range."""
    if np.issubdtype(dtype, np.integer):
        limits = np.iinfo(dtype)
        return np.clip(np.rint(values), limits.min, limits.max).astype(dtype)
    return values.astype(dtype)
