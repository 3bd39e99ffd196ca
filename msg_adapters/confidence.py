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

"""Confidence maps: scores over a region of the image -> a 32FC1 image aligned with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from msg_adapters.boxes import checked_box
from msg_adapters.image import message_from_image


def message_from_confidence(scores: npt.NDArray[np.float32], region: Sequence[float],
                            image_shape: tuple[int, int],
                            header: Header | None = None) -> Image:
    """
    Return scores as a 32FC1 image of the size of the source image.

    Parameters are those of :func:`aligned_confidence`, and the source image's header.
    """
    return message_from_image(aligned_confidence(scores, region, image_shape),
                              encoding='32FC1', header=header)


def aligned_confidence(scores: npt.NDArray[np.float32], region: Sequence[float],
                       image_shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    """
    Resample scores over a region onto the pixels of the image.

    Cell (i, j) of the scores covers one part of the region in each direction, with its
    value in the middle. Between the middles values are interpolated (bilinear), towards
    the rim they stay constant, and pixels whose center lies outside the region are 0.

    Parameters
    ----------
    scores : ndarray, shape (m, n), float32
        Rows downwards, columns to the right.
    region : (x, y, width, height)
        In image pixels; need not be whole and may exceed the image.
    image_shape : (height, width)
        Of the source image, in pixels.

    Returns
    -------
    ndarray, shape (height, width), float32

    Raises
    ------
    BoxMessageError
        When the region is empty or not finite.

    """
    x, y, width, height = checked_box(region)
    aligned = np.zeros(image_shape, np.float32)
    rows, upper, lower, down = _interpolation(y, height, scores.shape[0], image_shape[0])
    columns, left, right, across = _interpolation(x, width, scores.shape[1], image_shape[1])
    # One direction at a time: a few hundred columns first, then only the rows in view.
    strips = scores[:, left] * (1 - across) + scores[:, right] * across
    aligned[rows, columns] = strips[upper] * (1 - down)[:, None] + strips[lower] * down[:, None]
    return aligned


def _interpolation(start: float, length: float, cells: int, pixels: int) -> tuple[
        slice, npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.float32]]:
    """
    Return how pixel centers along one axis mix the cells of a region.

    Returns
    -------
    inside : slice
        Pixels with their center in the region.
    first, second : ndarray of int, one for each of these pixels
        The two nearest cells.
    weight : ndarray of float32
        Share of the second.

    """
    begin, end = np.clip(np.ceil([start - 0.5, start + length - 0.5]), 0, pixels).astype(int)
    centers = np.arange(begin, end) + 0.5
    position = np.clip((centers - start) / length * cells - 0.5, 0, cells - 1)
    first = np.floor(position).astype(np.intp)
    return (slice(begin, end), first, np.minimum(first + 1, cells - 1),
            (position - first).astype(np.float32))
