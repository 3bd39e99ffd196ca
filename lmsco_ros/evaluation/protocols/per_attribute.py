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

from lmsco_ros.evaluation.geometry import Array, steps_in_sizes

Flags = npt.NDArray[np.bool_]

_LOW_RESOLUTION = 1000.0


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


def box_attributes(truth: Array) -> dict[str, Flags]:
    """
    Return what the true boxes themselves tell of each frame.

    The limits are those by which LaSOT (Fan et al., CVPR 2019) gives attributes to sequences.

    Parameters
    ----------
    truth : ndarray, shape (n, 4)
        True boxes (x, y, width, height) in pixels; NaN where the target is absent.

    Returns
    -------
    dict of str to ndarray, shape (n,), bool
        `fast_motion`: the center has moved by more than the target's size since the frame before.
        `scale_variation`: the area, over that of the first box, is outside [1/2, 2].
        `aspect_ratio_change`: so is width over height. `low_resolution`: the area is below 1000
        pixels. `empty`: nothing of these. Where the target is absent, all are False.

    """
    present = np.isfinite(truth).all(axis=1)
    first = truth[present.argmax()]
    area, shape = np.prod(truth[:, 2:], axis=1), truth[:, 2] / truth[:, 3]
    flags = {
        'fast_motion': steps_in_sizes(truth) > 1,
        'scale_variation': _has_changed(area / np.prod(first[2:])),
        'aspect_ratio_change': _has_changed(shape / (first[2] / first[3])),
        'low_resolution': area < _LOW_RESOLUTION,
    }
    return {**flags, 'empty': present & ~np.any(list(flags.values()), axis=0)}


def _has_changed(ratio: Array) -> Flags:
    return np.asarray((ratio > 2) | (ratio < 0.5), np.bool_)


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
