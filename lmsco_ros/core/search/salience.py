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

"""Where in an image something stands out from its surroundings as the target does."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox

__all__ = ['Salience']

# The image is reduced for the search, to this side of the target and this many pixels at most.
_SIDE = 10.0
_PIXELS = 100_000
# Standard deviation below which surroundings count as even, in the working range.
_EVEN = 0.01
_PATCH = 32


class Salience:
    """
    Signal-to-clutter ratio over the whole image.

    It says how far a window of the target's size differs from the ring around it, over the
    standard deviation in that ring. That tells where a thermal target may be, whatever it looks
    like, at the price of a few box filters.

    Parameters
    ----------
    view : FrameView
        First frame.
    box : BoundingBox
        The target in it; tells whether to look for something warmer or colder than its
        surroundings.

    """

    def __init__(self, view: FrameView, box: BoundingBox) -> None:
        self._sign = 1.0 if _is_warm(view, box) else -1.0

    def candidates(self, view: FrameView, box: BoundingBox, count: int,
                   scales: Sequence[float] = (1.0,)) -> list[BoundingBox]:
        """
        Return boxes around what stands out most, the most salient first.

        Parameters
        ----------
        view : FrameView
            A frame.
        box : BoundingBox
            The target as it was seen last.
        count : int
            How many at most.
        scales : sequence of float
            Sizes to look for, relative to `box`.

        """
        shrink = min(1.0, _SIDE / box.area**0.5, (_PIXELS / (view.size[0] * view.size[1]))**0.5)
        size = max(1, round(shrink * view.size[0])), max(1, round(shrink * view.size[1]))
        pixels = view.patch(BoundingBox(0, 0, *view.size), size)
        step = view.size[0] / size[0], view.size[1] / size[1]
        found = []
        for scale in scales:
            sides = box.width * scale, box.height * scale
            window = tuple(max(1, round(s / d)) for s, d in zip(sides, step, strict=True))
            for ratio, row, column in _peaks(self._ratio(pixels, window), window, count):
                center = (column + 0.5) * step[0], (row + 0.5) * step[1]
                found.append((ratio, BoundingBox.from_center(center, sides)))
        found.sort(key=lambda candidate: -candidate[0])
        return [candidate for _, candidate in found[:count]]

    def _ratio(self, pixels: np.ndarray, window: tuple[int, ...]) -> np.ndarray:
        """Return the ratio for the window (width, height) around each pixel."""
        around = tuple(2 * side + 1 for side in window)
        share = window[0] * window[1] / (around[0] * around[1])
        inside = cv2.blur(pixels, window)
        ring = (cv2.blur(pixels, around) - share * inside) / (1 - share)
        squares = pixels * pixels
        power = (cv2.blur(squares, around) - share * cv2.blur(squares, window)) / (1 - share)
        clutter = np.sqrt(np.maximum(power - ring**2, 0))
        return self._sign * (inside - ring) / (clutter + np.float32(_EVEN))


def _is_warm(view: FrameView, box: BoundingBox) -> bool:
    """Return whether the target differs from its surroundings by its warmest or coldest part."""
    region = BoundingBox.from_center(box.center, (2 * box.width, 2 * box.height))
    pixels = view.patch(region, (_PATCH, _PATCH))
    middle = slice(_PATCH // 4, -_PATCH // 4)
    inside = pixels[middle, middle]
    ring = np.ones(pixels.shape, bool)
    ring[middle, middle] = False
    usual = np.median(pixels[ring])
    return bool(np.percentile(inside, 98) - usual >= usual - np.percentile(inside, 2))


def _peaks(ratio: np.ndarray, window: tuple[int, ...],
           count: int) -> list[tuple[float, int, int]]:
    """Return value, row and column of the highest maxima that are a window apart."""
    around = np.ones((window[1] | 1, window[0] | 1), np.uint8)
    rows, columns = np.nonzero((ratio >= cv2.dilate(ratio, around)) & (ratio > 0))
    values = ratio[rows, columns]
    order = np.argsort(-values)[:count]
    return [(float(values[i]), int(rows[i]), int(columns[i])) for i in order]
