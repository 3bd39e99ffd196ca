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

"""Regions of a frame: what is searched, where a box may lie, tiles."""

from __future__ import annotations

import math

import numpy as np

from lmsco_ros.core.config import SamplingConfig
from lmsco_ros.core.errors import BoxError
from lmsco_ros.core.types import BoundingBox

__all__ = ['at_border', 'check_box', 'clamp_box', 'held_at_border', 'patch_size', 'region_around',
           'search_tiles', 'visible_part']

_SMALLEST_TARGET = 2.0

_VISIBLE_PART = 0.25
_BORDER_PIXELS = 1.5


def region_around(box: BoundingBox, config: SamplingConfig) -> BoundingBox:
    """Return the square search region around a target."""
    side = config.search_factor * math.sqrt(box.area)
    return BoundingBox.from_center(box.center, (side, side))


def patch_size(size: tuple[float, float], config: SamplingConfig, cell: int) -> int:
    """
    Return the side of the patch in pixels.

    Parameters
    ----------
    size : tuple of float
        Target (width, height).
    config : SamplingConfig
        Limits of the patch.
    cell : int
        The side is a multiple of it; the number of cells is odd and a product of small primes,
        on which Fourier transforms are fast.

    """
    side = config.search_factor * math.sqrt(size[0] * size[1])
    wanted = min(max(side, config.patch_size_min), config.patch_size_max)
    counts = [n for n in range(5, 2 + config.patch_size_max // cell) if _is_fast_odd(n)]
    return cell * min(counts, key=lambda n: abs(n * cell - wanted))


def _is_fast_odd(number: int) -> bool:
    """Return whether `number` is odd and its prime factors are at most 13."""
    if number % 2 == 0:
        return False
    for prime in (3, 5, 7, 11, 13):
        while number % prime == 0:
            number //= prime
    return number == 1


def search_tiles(image_size: tuple[int, int], side: float,
                 around: tuple[float, float]) -> list[tuple[float, float]]:
    """
    Return the centers of regions that together cover the image, nearest first.

    Parameters
    ----------
    image_size : tuple of int
        Width and height.
    side : float
        Side of a region; neighbors overlap by half of it.
    around : tuple of float
        Point (x, y) from which the search spreads.

    """
    axes = []
    for length in image_size:
        count = max(1, math.ceil(length / (side / 2)))
        axes.append((np.arange(count) + 0.5) * length / count)
    centers = [(float(x), float(y)) for y in axes[1] for x in axes[0]]
    return sorted(centers, key=lambda c: math.dist(c, around))


def check_box(box: BoundingBox, image_size: tuple[int, int]) -> None:
    """
    Raise BoxError unless a target in `box` can be learned.

    Parameters
    ----------
    box : BoundingBox
        Target; may reach over the border of the image, by three quarters of its area at most.
        What is wider or higher than the image is refused: that is a mistake in units or in the
        image, or of a target of which only the visible part can be learned.
    image_size : tuple of int
        Width and height.

    """
    if min(box.size) < _SMALLEST_TARGET:
        raise BoxError(f'box {box.as_tuple()} is smaller than {_SMALLEST_TARGET:g} pixels; '
                       'mark the target with some pixels in each direction')
    size = f'the image of {image_size[0]} x {image_size[1]} pixels'
    if box.width > image_size[0] or box.height > image_size[1]:
        raise BoxError(f'box {box.as_tuple()} is larger than {size}; mark the visible part of '
                       'the target, as (x, y, width, height) in pixels of this image')
    visible = box.intersection(BoundingBox(0, 0, *image_size))
    if visible < _VISIBLE_PART * box.area:
        raise BoxError(f'box {box.as_tuple()} has {visible / box.area:.1%} of its area in {size}, '
                       f'less than {_VISIBLE_PART:.0%}; mark the visible part of the target')


def clamp_box(box: BoundingBox, image_size: tuple[int, int]) -> BoundingBox:
    """
    Return the box with its center in the image and a size that can be tracked.

    Parameters
    ----------
    box : BoundingBox
        Estimated target.
    image_size : tuple of int
        Width and height.

    """
    center = tuple(min(max(c, 0.0), float(length))
                   for c, length in zip(box.center, image_size, strict=True))
    grow = _SMALLEST_TARGET / min(box.size)
    shrink = 2 * math.hypot(*image_size) / max(box.size)
    return BoundingBox.from_center((center[0], center[1]), box.size).scaled(
        min(max(1.0, grow), shrink))


def visible_part(box: BoundingBox, image_size: tuple[int, int]) -> BoundingBox:
    """Return the part of a box in the image; its center must not lie outside."""
    low = max(box.x, 0.0), max(box.y, 0.0)
    high = (min(box.x + box.width, float(image_size[0])),
            min(box.y + box.height, float(image_size[1])))
    inside = low == (box.x, box.y) and high == (box.x + box.width, box.y + box.height)
    return box if inside else BoundingBox(*low, high[0] - low[0], high[1] - low[1])


def at_border(box: BoundingBox,
              image_size: tuple[float, float]) -> tuple[tuple[bool, bool], tuple[bool, bool]]:
    """Return whether left and right, upper and lower edge lie at the border, or beyond it."""
    horizontal, vertical = (
        (start < _BORDER_PIXELS, start + length > limit - _BORDER_PIXELS)
        for start, length, limit in zip((box.x, box.y), box.size, image_size, strict=True))
    return horizontal, vertical


def held_at_border(box: BoundingBox, last: BoundingBox,
                   image_size: tuple[int, int]) -> BoundingBox:
    """
    Return a box with the edges at the border that it had there in the last frame.

    What moves away from the border shows more of itself behind, until the whole of it is in view.

    Parameters
    ----------
    box : BoundingBox
        The target as large as in the last frame.
    last : BoundingBox
        The target in that frame.
    image_size : tuple of int
        Width and height.

    """
    if not any(map(any, at_border(last, image_size))):
        return box
    edges = [
        (min(start, 0.0) if low else start, max(end, float(limit)) if high else end)
        for start, end, limit, (low, high) in zip(
            (box.x, box.y), (box.x + box.width, box.y + box.height), image_size,
            at_border(last, image_size), strict=True)]
    (left, right), (top, bottom) = edges
    return BoundingBox(left, top, right - left, bottom - top)
