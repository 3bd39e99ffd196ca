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

"""Pixels of a thermal frame: gray, without a value, dead."""

from __future__ import annotations

import cv2
import numpy as np

__all__ = ['filled', 'measured', 'to_gray', 'without_dead_pixels']

# No sensor counts as far; the largest numbers that there are stand for pixels without a value.
_LARGEST = 1e12


def to_gray(pixels: np.ndarray) -> np.ndarray:
    """Return one channel; gray pixels pass through."""
    return pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)


def measured(pixels: np.ndarray) -> np.ndarray:
    """
    Return pixels with NaN in place of numbers that no camera measures.

    Parameters
    ----------
    pixels : ndarray
        Of a frame; they are returned themselves unless there are floating-point numbers beyond
        1e12 among them.

    """
    if pixels.dtype.kind != 'f':
        return pixels
    beyond = np.abs(pixels) > _LARGEST
    return np.where(beyond, pixels.dtype.type(np.nan), pixels) if beyond.any() else pixels


def filled(pixels: np.ndarray) -> np.ndarray:
    """Return float32 pixels with the middle of the others in place of those without a value."""
    values = pixels.astype(np.float32, copy=False)
    finite = np.isfinite(values)
    if finite.all():
        return values
    middle = np.median(values[finite]) if finite.any() else np.float32(0)
    return np.where(finite, values, middle)


def without_dead_pixels(pixels: np.ndarray, spread: float) -> np.ndarray:
    """
    Return a part of a frame with the dead pixels, alone or in lines, filled in.

    A pixel is dead when it stands out from the median of its 3 x 3 neighborhood, which takes
    its place. Edges and targets of three pixels and more stay as they are, but for corners.

    Parameters
    ----------
    pixels : ndarray, shape (h, w)
        Counts; those that are not finite stay as they are.
    spread : float
        Difference from the median, in counts, above which a pixel stands out.

    """
    values = filled(pixels) if pixels.dtype == np.float32 else pixels
    if _is_smooth(values, spread):
        return pixels
    median = cv2.medianBlur(values, 3)
    if cv2.norm(values, median, cv2.NORM_INF) <= spread:
        return pixels
    dead = cv2.absdiff(values, median) > spread
    return np.where(dead & np.isfinite(pixels), median, pixels)


def _is_smooth(pixels: np.ndarray, spread: float) -> bool:
    """
    Return whether no pixel differs from one beside, above or below it by more than `spread`.

    Then none stands out from its median either: of eight neighbors it would from five.
    """
    steps = (pixels[1:], pixels[:-1]), (pixels[:, 1:], pixels[:, :-1])
    return all(cv2.norm(after, before, cv2.NORM_INF) <= spread
               for after, before in steps if before.size)
