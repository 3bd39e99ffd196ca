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

"""A frame seen through a regular subset of its pixels: percentiles, credible values, noise."""

from __future__ import annotations

import cv2
import numpy as np

from lmsco_ros.core.imaging.pixels import filled, measured, to_gray

__all__ = ['credible_values', 'noise_deviation', 'percentiles', 'take_probe']

_PROBE_POINTS = 8192
_NOISE_POINTS = 4096

# Telemetry read as pixels: neighbors differ as much as any two pixels of the row do (a ratio
# of 1.3 for noise), and the row spreads over more than the scene (in units of its spread).
_NOISE_RATIO = 0.8

_NOISE_SPREAD = 2.0

# Of the second difference of white noise, over its own deviation; and the median of the amount
# of a normal distribution, over its deviation.
_SECOND_DIFFERENCE, _MEDIAN = 6**0.5, 0.6745


def take_probe(image: np.ndarray) -> np.ndarray:
    """
    Return the frame seen through every n-th pixel in both directions.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        A frame.

    Returns
    -------
    ndarray, shape (h, w)
        Gray, contiguous, about 8000 pixels; all of them for smaller frames. A copy: it is
        compared with the next frame, for which the caller may use the same memory.

    """
    step = _step(image)
    return measured(to_gray(image[step // 2::step, step // 2::step].copy()))


def percentiles(values: np.ndarray, shares: tuple[float, ...]) -> list[float]:
    """
    Return percentiles with linear interpolation.

    Parameters
    ----------
    values : ndarray
        At least one, all finite.
    shares : tuple of float
        In percent.

    """
    places = np.asarray(shares) / 100 * (values.size - 1)
    below = np.floor(places).astype(int)
    above = np.minimum(below + 1, values.size - 1)
    order = np.partition(values, sorted({*below.tolist(), *above.tolist()}), axis=None)
    start, end = order[below].astype(np.float64), order[above].astype(np.float64)
    return (start + (places - below) * (end - start)).tolist()


def credible_values(image: np.ndarray, probe: np.ndarray, spread: float) -> np.ndarray:
    """
    Return the pixels of a probe without the ones that are no picture of the scene.

    Left out are pixels without a finite value; dead ones, alone or in lines, which stand out
    from both neighbors on a diagonal; and rows of telemetry, which are noise.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        The frame.
    probe : ndarray, shape (h, w)
        Its probe.
    spread : float
        Range of most of the scene, in counts: the measure of what stands out.

    Returns
    -------
    ndarray, shape (n,)
        In the order of the probe; empty when nothing is left.

    """
    finite = np.isfinite(probe)
    center, before, after, right = (
        filled(pixels) for pixels in (probe, *(
            _neighbors(image, probe.shape, *shift) for shift in ((-1, -1), (1, 1), (0, 1)))))
    low, high = np.minimum(before, after), np.maximum(before, after)
    alone = (center > high + spread) | (center < low - spread)
    repaired = np.clip(center, low, high)
    roughness = np.abs(repaired - right).mean(axis=1)
    deviation = np.abs(repaired - repaired.mean(axis=1, keepdims=True)).mean(axis=1)
    noise = (roughness > _NOISE_RATIO * deviation) & (deviation > _NOISE_SPREAD * spread)
    return probe[finite & ~alone & ~noise[:, None]]


def noise_deviation(image: np.ndarray) -> float:
    """
    Return the standard deviation of the noise of a frame, in counts.

    That of what a pixel differs by from the mean of its neighbors in the row, by its median: the
    edges of a scene are few. A fine texture counts as noise, in which a target is as hard to see.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        A frame; pixels without a value do not count.

    """
    height, width = image.shape[:2]
    step = min(height, max(1, height * width // _NOISE_POINTS))
    rows = measured(to_gray(image[step // 2::step])).astype(np.float32, copy=False)
    second = np.abs(rows[:, 2:] + rows[:, :-2] - 2 * rows[:, 1:-1])
    known = second[np.isfinite(second)] if image.dtype == np.float32 else second.ravel()
    return percentiles(known, (50.0,))[0] / (_MEDIAN * _SECOND_DIFFERENCE) if known.size else 0.0


def _step(image: np.ndarray) -> int:
    return max(1, int((image.shape[0] * image.shape[1] / _PROBE_POINTS)**0.5))


def _neighbors(image: np.ndarray, shape: tuple[int, ...], down: int, right: int) -> np.ndarray:
    """Return the pixels beside those of a probe of this shape."""
    step = _step(image)
    start = step // 2
    if start == 0:
        image, start = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_REFLECT_101), 1
    pixels = np.ascontiguousarray(image[start + down::step, start + right::step])
    pixels = measured(to_gray(pixels[:shape[0], :shape[1]]))
    # The last pixels of the probe may lie on the border of the image.
    missing = shape[0] - pixels.shape[0], shape[1] - pixels.shape[1]
    return cv2.copyMakeBorder(pixels, 0, missing[0], 0, missing[1], cv2.BORDER_REPLICATE)
