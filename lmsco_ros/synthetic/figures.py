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

"""Warm bodies made of capsules: drawn without jaggies, bounded exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox


@dataclass(frozen=True)
class Capsule:
    """
    A line with round ends, from (x0, y0) to (x1, y1).

    Attributes
    ----------
    x0, y0, x1, y1 : float
        Ends of the line, in pixels; pixel (0, 0) covers [0, 1) x [0, 1).
    radius : float
        Half of the thickness, in pixels.
    heat : float
        Sensor counts of its surface.

    """

    x0: float
    y0: float
    x1: float
    y1: float
    radius: float
    heat: float


@dataclass(frozen=True)
class Layer:
    """
    A body as the sensor grid sees it.

    Attributes
    ----------
    rows, columns : slice
        Where the layer lies in the image; empty when it is out of sight.
    alpha : ndarray, shape (h, w), float32
        Share of each pixel that the body covers.
    heat : ndarray, shape (h, w), float32
        Counts of the body there.

    """

    rows: slice
    columns: slice
    alpha: npt.NDArray[np.float32]
    heat: npt.NDArray[np.float32]


@dataclass(frozen=True)
class Clothes:
    """
    How warm parts of a person look, as shares of the warmth of the whole.

    Attributes
    ----------
    head, torso, arms, legs : float
        Factors; of two limbs the one behind is a little colder.

    """

    head: float = 1.03
    torso: float = 1.0
    arms: float = 1.012
    legs: float = 0.99


def walker(foot: tuple[float, float], height: float, phase: float, heat: float,
           clothes: Clothes = Clothes()) -> tuple[Capsule, ...]:
    """
    Return a person who walks.

    Parameters
    ----------
    foot : (x, y)
        Point on the ground below the body, in pixels.
    height : float
        Height of the body, in pixels.
    phase : float
        Phase of the step, in radians; arms and legs swing once in 2 pi.
    heat : float
        Counts of the body.
    clothes : Clothes
        What of it each part shows.

    """
    x, ground = foot
    swing = math.sin(phase)

    def limb(top: float, bottom: float, reach: float, radius: float, warmth: float) -> Capsule:
        lift = 0.03 * abs(reach)
        return Capsule(x, ground - top * height, x + reach * 0.14 * height,
                       ground - (bottom + lift + radius) * height, radius * height,
                       heat * warmth)

    head = Capsule(x, ground - 0.92 * height, x, ground - 0.90 * height, 0.08 * height,
                   clothes.head * heat)
    torso = Capsule(x, ground - 0.72 * height, x, ground - 0.52 * height, 0.12 * height,
                    clothes.torso * heat)
    return (limb(0.48, 0.0, swing, 0.055, clothes.legs),
            limb(0.48, 0.0, -swing, 0.055, clothes.legs - 0.005),
            torso, head,
            limb(0.77, 0.40, -0.8 * swing, 0.035, clothes.arms - 0.004),
            limb(0.77, 0.40, 0.8 * swing, 0.035, clothes.arms))


def bounds(capsules: Sequence[Capsule]) -> BoundingBox:
    """Return the smallest box around `capsules`."""
    left = min(min(c.x0, c.x1) - c.radius for c in capsules)
    top = min(min(c.y0, c.y1) - c.radius for c in capsules)
    right = max(max(c.x0, c.x1) + c.radius for c in capsules)
    bottom = max(max(c.y0, c.y1) + c.radius for c in capsules)
    return BoundingBox(left, top, right - left, bottom - top)


def rasterize(capsules: Sequence[Capsule], image_shape: tuple[int, int]) -> Layer:
    """Return `capsules`, later ones in front, on the pixel grid of an image (H, W)."""
    box = bounds(capsules)
    rows = _span(box.y, box.height, image_shape[0])
    columns = _span(box.x, box.width, image_shape[1])
    y = np.arange(rows.start, rows.stop, dtype=np.float32)[:, None] + np.float32(0.5)
    x = np.arange(columns.start, columns.stop, dtype=np.float32)[None, :] + np.float32(0.5)
    alpha = np.zeros((y.size, x.size), np.float32)
    heat = np.full((y.size, x.size), capsules[0].heat, np.float32)
    for capsule in capsules:
        cover = np.clip(np.float32(0.5) - _distance(capsule, x, y), 0, 1)
        heat += cover * (np.float32(capsule.heat) - heat)
        np.maximum(alpha, cover, out=alpha)
    return Layer(rows, columns, alpha, heat)


def _span(start: float, length: float, limit: int) -> slice:
    """Return the pixels that an interval touches, with one spare on each side."""
    first = min(max(math.floor(start) - 1, 0), limit)
    last = min(max(math.ceil(start + length) + 1, first), limit)
    return slice(first, last)


def _distance(capsule: Capsule, x: npt.NDArray[np.float32],
              y: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the signed distance of pixel centers to the capsule's surface."""
    along_x, along_y = capsule.x1 - capsule.x0, capsule.y1 - capsule.y0
    squared = max(along_x ** 2 + along_y ** 2, 1e-9)
    place = np.clip(((x - capsule.x0) * along_x + (y - capsule.y0) * along_y) / squared, 0, 1)
    distance = np.hypot(x - capsule.x0 - place * along_x, y - capsule.y0 - place * along_y)
    return np.asarray(distance - capsule.radius, np.float32)
