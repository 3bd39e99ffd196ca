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

"""What a thermal camera and its surroundings do to a picture between two frames."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

__all__ = ['degrade', 'occlude']

Patch = npt.NDArray[np.float32]


def degrade(patch: Patch, rng: np.random.Generator) -> Patch:
    """
    Return the patch as another moment of another sensor would show it.

    Blur, a jump of gain and offset, fixed-pattern noise of rows and columns, and white noise,
    each with a chance of its own.

    Parameters
    ----------
    patch : ndarray, shape (S, S), float32
        Intensities in the working range.
    rng : Generator
        Source of chance.

    """
    if rng.random() < 0.3:
        patch = cv2.GaussianBlur(patch, (0, 0), float(rng.uniform(0.3, 1.5)))
    if rng.random() < 0.15:
        patch = _motion_blur(patch, rng)
    if rng.random() < 0.5:
        patch = patch * np.float32(np.exp(rng.normal(0, 0.25))) + np.float32(rng.normal(0, 0.15))
    if rng.random() < 0.2:
        strength = rng.uniform(0, 0.04)
        patch = patch + rng.normal(0, strength, patch.shape[0])[:, None]
        patch = patch + rng.normal(0, strength, patch.shape[1])[None, :]
    if rng.random() < 0.6:
        patch = patch + rng.normal(0, rng.uniform(0, 0.05), patch.shape)
    return patch.astype(np.float32)


def occlude(patch: Patch, target: float, rng: np.random.Generator) -> Patch:
    """
    Return the patch with something in front of a part of the target.

    Parameters
    ----------
    patch : ndarray, shape (S, S), float32
        Intensities; the target is near the middle.
    target : float
        Side of the target in pixels of the patch.
    rng : Generator
        Source of chance.

    """
    size = patch.shape[0]
    side = np.maximum(1, rng.uniform(0.3, 0.8, 2) * target).astype(int)
    corner = np.maximum(0, size / 2 + rng.uniform(-0.7, 0.3, 2) * target).astype(int)
    source = rng.integers(0, size - side)
    result = patch.copy()
    hidden = result[corner[0]:corner[0] + side[0], corner[1]:corner[1] + side[1]]
    hidden[:] = patch[source[0]:, source[1]:][:hidden.shape[0], :hidden.shape[1]]
    return result


def _motion_blur(patch: Patch, rng: np.random.Generator) -> Patch:
    """Return the patch smeared along a random line, evenly to both sides."""
    reach = int(rng.integers(1, 3))
    end = (reach, int(rng.integers(-reach, reach + 1)))
    dx, dy = end if rng.random() < 0.5 else end[::-1]
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    cv2.line(kernel, (reach - dx, reach - dy), (reach + dx, reach + dy), 1.0)
    # A slanted line of pixels is not symmetric; with its mirror image it moves nothing.
    kernel = kernel + kernel[::-1, ::-1]
    return cv2.filter2D(patch, -1, kernel / float(kernel.sum()), borderType=cv2.BORDER_REPLICATE)
