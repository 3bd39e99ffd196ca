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

"""Figures on the frames of each attribute, pooled over sequences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.geometry import Array

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class AttributeFigures:
    """
    How a tracker does on the frames of one attribute.

    Attributes
    ----------
    frames : int
        Frames that count for the mean overlap.
    mean_overlap : float
        Mean overlap on them, NaN without any.
    failures : int
        Failures that fell on frames of the attribute.

    """

    frames: int
    mean_overlap: float
    failures: int


def attribute_figures(overlap: Array, counted: Flags, failures: Sequence[int],
                      attributes: Mapping[str, Flags]) -> dict[str, AttributeFigures]:
    """
    Return the figures for each attribute.

    Parameters
    ----------
    overlap : ndarray, shape (n,)
        Overlap of each frame, of all sequences one after the other; NaN where absent.
    counted : ndarray, shape (n,), bool
        Frames that count for the mean overlap.
    failures : sequence of int
        Indices of the failures.
    attributes : mapping of str to ndarray, shape (n,), bool
        Frames of each attribute.

    """
    usable = counted & np.isfinite(overlap)
    result = {}
    for name, flags in attributes.items():
        values = overlap[usable & flags]
        result[name] = AttributeFigures(
            frames=values.size,
            mean_overlap=float(values.mean()) if values.size else float('nan'),
            failures=int(flags[list(failures)].sum()))
    return result
