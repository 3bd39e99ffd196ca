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

"""Take a target out of an image, or put a second one into it."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.intensities import stored

Box = npt.NDArray[np.float64]

_INPAINT_RADIUS = 3
# A normal deviation over the median of its absolute values.
_DEVIATION = 1.4826


def without_region(image: npt.NDArray, box: Box, rng: np.random.Generator) -> npt.NDArray:
    """
    Return the image with background in place of what is in and close around a box.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        Any depth; 8 bit with three channels.
    box : ndarray, shape (4,)
        x, y, width, height; a fifth of its size is added on each side, 2 pixels at least.
    rng : numpy.random.Generator
        Draws the noise that the surroundings have and a smooth filling would lack.

    """
    margin = np.maximum(0.2 * box[2:], 2)
    inner = _pixels(box[:2] - margin, box[2:] + 2 * margin, image.shape)
    ring = np.maximum(0.5 * box[2:], 6)
    outer = _pixels(box[:2] - ring - margin, box[2:] + 2 * (ring + margin), image.shape)
    mask = np.zeros(image.shape[:2], np.uint8)
    mask[inner] = 1
    part, mask = np.ascontiguousarray(image[outer]), mask[outer]
    if not mask.any() or mask.all():
        return image
    filled = cv2.inpaint(part, mask, _INPAINT_RADIUS, cv2.INPAINT_TELEA).astype(np.float32)
    filled += rng.normal(0, noise_deviation(part, mask == 0), filled.shape)
    result = image.copy()
    result[outer][mask > 0] = stored(filled, image.dtype)[mask > 0]
    return result


def with_copy(image: npt.NDArray, box: Box, offset: npt.NDArray[np.float64]) -> npt.NDArray:
    """
    Return the image with what is in a box a second time, `offset` (x, y) pixels away.

    The copy fades into its new surroundings over a tenth of the size of the box.
    """
    margin = np.maximum(0.1 * box[2:], 1)
    size = np.ceil(box[2:] + 2 * margin).astype(int)
    center = box[:2] + box[2:] / 2
    values = image.astype(np.float32)
    patch = cv2.getRectSubPix(values, size.tolist(), tuple((center - 0.5).tolist()))
    alpha = np.zeros(size[::-1], np.float32)
    edge = np.maximum(np.round(margin).astype(int), 1)
    alpha[edge[1]:-edge[1], edge[0]:-edge[0]] = 1
    alpha = cv2.blur(alpha, (2 * int(edge[0]) + 1, 2 * int(edge[1]) + 1),
                     borderType=cv2.BORDER_CONSTANT)
    move = np.column_stack([np.eye(2), center + offset - size / 2])
    frame = image.shape[1], image.shape[0]
    patch = cv2.warpAffine(patch, move, frame, borderMode=cv2.BORDER_REPLICATE)
    alpha = cv2.warpAffine(alpha, move, frame)
    alpha = alpha if image.ndim == 2 else alpha[..., None]
    return stored(values + alpha * (patch - values), image.dtype)


def noise_deviation(image: npt.NDArray, where: npt.NDArray[np.bool_]) -> float:
    """Return the deviation of the noise in the pixels of an image that are chosen by `where`."""
    values = image.astype(np.float32)
    rest = (values - cv2.GaussianBlur(values, (0, 0), 1))[where]
    return float(_DEVIATION * np.median(np.abs(rest)))


def _pixels(corner: Box, size: Box, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Return the pixels of an image that a box touches."""
    limits = np.array([shape[1], shape[0]])
    low = np.clip(np.floor(corner), 0, limits).astype(int)
    high = np.clip(np.ceil(corner + size), 0, limits).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])
