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
Overlap and center error of many boxes at once.

Boxes are rows (x, y, width, height) in the convention of
`lmsco_ros.core.BoundingBox`: (x, y) is the top-left corner and pixel (0, 0)
covers [0, 1) x [0, 1). A row of NaN in the ground truth says that the target is
absent; a row of NaN in the answers says that the tracker gave none.
"""

from __future__ import annotations


import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# Sizes of the target that it moves by from one frame to the next when it jumps, not flies.
_JUMP_SIZES = 2.0


def clip_boxes(boxes: Array, size: tuple[int, int]) -> Array:
    """
    Return the part of each box that lies in the image.

    Parameters
    ----------
    boxes : ndarray, shape (n, 4)
        Boxes in pixels.
    size : (int, int)
        Width and height of the image in pixels.

    Returns
    -------
    ndarray, shape (n, 4)
        Boxes without what is outside; width or height 0 where nothing is left.

    """
    limits = np.asarray(size, dtype=float)
    low = np.clip(boxes[:, :2], 0, limits)
    high = np.clip(boxes[:, :2] + boxes[:, 2:], 0, limits)
    return np.concatenate([low, high - low], axis=1)


def overlaps(ground_truth: Array, boxes: Array,
             size: tuple[int, int] | None = None) -> Array:
    """
    Return intersection over union for each frame.

    Parameters
    ----------
    ground_truth, boxes : ndarray, shape (n, 4)
        True and estimated boxes in pixels.
    size : (int, int), optional
        Width and height of the image; when given, only what lies in the image counts,
        as in the VOT protocol.

    Returns
    -------
    ndarray, shape (n,)
        Values in [0, 1]; 0 where the tracker gave no box, NaN where the target is absent.

    """
    if size is not None:
        ground_truth, boxes = clip_boxes(ground_truth, size), clip_boxes(boxes, size)
    low = np.maximum(ground_truth[:, :2], boxes[:, :2])
    high = np.minimum(ground_truth[:, :2] + ground_truth[:, 2:], boxes[:, :2] + boxes[:, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=1)
    union = np.prod(ground_truth[:, 2:], axis=1) + np.prod(boxes[:, 2:], axis=1) - common
    ratio = np.divide(common, union, out=np.zeros(len(common)), where=union > 0)
    # Rounding lifts the overlap of equal boxes just above 1.
    return np.where(is_absent(ground_truth), np.nan, np.minimum(ratio, 1))


def center_offsets(ground_truth: Array, boxes: Array) -> Array:
    """
    Return the vector from the true to the estimated center for each frame.

    Returns
    -------
    ndarray, shape (n, 2)
        Offsets (x, y) in pixels; infinite where the tracker gave no box, NaN where the
        target is absent.

    """
    offsets = (boxes[:, :2] + boxes[:, 2:] / 2) - (ground_truth[:, :2] + ground_truth[:, 2:] / 2)
    offsets = np.where(is_absent(boxes)[:, None], np.inf, offsets)
    return np.where(is_absent(ground_truth)[:, None], np.nan, offsets)


def has_jumped(ground_truth: Array) -> npt.NDArray[np.bool_]:
    """
    Return for each row, shape (n,), whether the target has jumped there, as after a cut.

    It has when its center moves by more than two of its sizes from one frame to the next.
    """
    return steps_in_sizes(ground_truth) > _JUMP_SIZES


def steps_in_sizes(boxes: Array) -> Array:
    """
    Return for each row, shape (n,), how far the center has moved since the row before.

    The unit is the size of the box before, the root of its area. The first row has not moved; it
    is NaN where one of the two boxes is absent.
    """
    centers = boxes[:, :2] + boxes[:, 2:] / 2
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    return np.append(0.0, steps / np.sqrt(np.prod(boxes[:-1, 2:], axis=1)))


def is_absent(boxes: Array) -> npt.NDArray[np.bool_]:
    """Return for each row, shape (n,), whether it is no box at all."""
    return np.asarray(~np.isfinite(boxes).all(axis=1), np.bool_)
