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

"""What scenes are put together from: a view of a panorama, and bodies behind one another."""

from __future__ import annotations

from collections.abc import Sequence
import math

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.synthetic.figures import bounds, Capsule, Layer, rasterize


def look(panorama: npt.NDArray[np.float32], pan: tuple[float, float],
         shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Return the part (H, W) of a panorama whose corner is at `pan`, to a fraction of a pixel."""
    shift = np.array([[1, 0, pan[0]], [0, 1, pan[1]]], np.float64)
    view = cv2.warpAffine(panorama, shift, shape[::-1], borderMode=cv2.BORDER_REPLICATE,
                          flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    return np.asarray(view, np.float32)


def compose(scene: npt.NDArray[np.float32], target: Sequence[Capsule],
            behind: Sequence[Layer], before: Sequence[Layer]) -> float:
    """
    Draw the target into a scene, and others behind and before it.

    Parameters
    ----------
    scene : ndarray, shape (H, W)
        Counts of what is behind all of them; drawn on.
    target : sequence of Capsule
        The body that is followed.
    behind, before : sequence of Layer
        The others, the nearest last.

    Returns
    -------
    float
        Share of the target's area that is neither hidden nor outside, in [0, 1].

    """
    for layer in behind:
        _paint(scene, layer)
    body = rasterize(target, scene.shape)
    _paint(scene, body)
    seen = np.zeros(scene.shape, np.float32)
    seen[body.rows, body.columns] = body.alpha
    for layer in before:
        _paint(scene, layer)
        seen[layer.rows, layer.columns] *= 1 - layer.alpha
    return min(1.0, float(seen.sum()) / _area(target))


def _paint(scene: npt.NDArray[np.float32], layer: Layer) -> None:
    view = scene[layer.rows, layer.columns]
    view += layer.alpha * (layer.heat - view)


def _area(capsules: Sequence[Capsule]) -> float:
    """Return the covered area in square pixels, wherever the body stands."""
    box = bounds(capsules)
    moved = [Capsule(c.x0 - math.floor(box.x) + 2, c.y0 - math.floor(box.y) + 2,
                     c.x1 - math.floor(box.x) + 2, c.y1 - math.floor(box.y) + 2,
                     c.radius, c.heat) for c in capsules]
    return float(rasterize(moved, (math.ceil(box.height) + 5, math.ceil(box.width) + 5))
                 .alpha.sum())
