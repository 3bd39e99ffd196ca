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

"""What a regular subset of a frame's pixels tells about the whole frame."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

__all__ = ['credible_values', 'is_frozen', 'measured', 'percentiles', 'SceneChange',
           'SceneMonitor', 'take_probe', 'to_gray', 'without_dead_pixels']

_PROBE_POINTS = 8192

# No sensor counts as far; the largest numbers that there are stand for pixels without a value.
_LARGEST = 1e12

# Consecutive frames of real sequences, camera in motion or not, correlate above -0.02, and
# mostly above 0.8: an inverted one lies far on the other side.
_INVERTED_CORRELATION = -0.5

# Of 42,900 pairs of consecutive frames, 27 correlate less than this: all of them cuts but four,
# in which a camera swept over treetops.
_CUT_CORRELATION = 0.7

# A telemetry line counts on while the picture stands, so the outermost rows do not decide.
_MARGIN_SHARE = 16

# Telemetry read as pixels: neighbors differ as much as any two pixels of the row do (a ratio
# of 1.3 for noise), and the row spreads over more than the scene (in units of its spread).
_NOISE_RATIO = 0.8
_NOISE_SPREAD = 2.0


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
        Gray, contiguous, about 8000 pixels; all of them for smaller frames.

    """
    step = _step(image)
    return measured(to_gray(np.ascontiguousarray(image[step // 2::step, step // 2::step])))


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
    order = np.partition(values, np.unique([*below, *above]), axis=None)
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
        _finite(pixels) for pixels in (probe, *(
            _neighbors(image, probe.shape, *shift) for shift in ((-1, -1), (1, 1), (0, 1)))))
    low, high = np.minimum(before, after), np.maximum(before, after)
    alone = (center > high + spread) | (center < low - spread)
    repaired = np.clip(center, low, high)
    roughness = np.abs(repaired - right).mean(axis=1)
    deviation = np.abs(repaired - repaired.mean(axis=1, keepdims=True)).mean(axis=1)
    noise = (roughness > _NOISE_RATIO * deviation) & (deviation > _NOISE_SPREAD * spread)
    return probe[finite & ~alone & ~noise[:, None]]


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
    values = _finite(pixels) if pixels.dtype == np.float32 else pixels
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


def is_frozen(previous: np.ndarray, probe: np.ndarray) -> bool:
    """
    Return whether the picture stands: the same bits as one frame before.

    Parameters
    ----------
    previous, probe : ndarray, shape (h, w)
        Probes of two frames. The outermost rows do not count, where telemetry counts on.

    """
    if previous.shape != probe.shape or previous.dtype != probe.dtype:
        return False
    margin = max(1, probe.shape[0] // _MARGIN_SHARE)
    return previous[margin:-margin].tobytes() == probe[margin:-margin].tobytes()


@dataclass(frozen=True)
class SceneChange:
    """
    What has happened between two frames.

    Attributes
    ----------
    switched : bool
        Warm and cold have changed places.
    cut : bool
        The picture shows another scene, or the same one from elsewhere.

    """

    switched: bool = False
    cut: bool = False


class SceneMonitor:
    """
    Tells when the camera switches its polarity (white hot, black hot), or its view.

    Two frames in a row show nearly the same scene. When their probes correlate negatively, warm
    and cold have changed places; when they hardly correlate, the view has been cut.
    """

    def __init__(self) -> None:
        self._pattern: np.ndarray | None = None
        self._inverted = False

    @property
    def inverted(self) -> bool:
        """Whether the polarity is not the one of the first frame."""
        return self._inverted

    def observe(self, probe: np.ndarray, low: float, high: float) -> SceneChange:
        """
        Take note of a frame and return what has just changed.

        Parameters
        ----------
        probe : ndarray, shape (h, w)
            Probe of the frame; pixels that are not finite do not count.
        low, high : float
            Range of its counts; what lies outside is cut off.

        """
        pattern = _pattern(probe, low, high)
        if pattern is None:
            return SceneChange()
        before, self._pattern = self._pattern, pattern
        if before is None or before.size != pattern.size:
            return SceneChange()
        correlation = float(np.dot(before, pattern))
        switched = correlation < _INVERTED_CORRELATION
        self._inverted ^= switched
        return SceneChange(switched, not switched and correlation < _CUT_CORRELATION)


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


def _finite(pixels: np.ndarray) -> np.ndarray:
    """Return float32 pixels with the middle of the others in place of those without a value."""
    values = pixels.astype(np.float32, copy=False)
    finite = np.isfinite(values)
    if finite.all():
        return values
    middle = np.median(values[finite]) if finite.any() else np.float32(0)
    return np.where(finite, values, middle)


def _pattern(probe: np.ndarray, low: float, high: float) -> np.ndarray | None:
    """Return the probe as a vector of mean 0 and length 1, None when it shows nothing."""
    values = probe.astype(np.float32).ravel()
    values -= np.float32(low)
    values *= np.float32(1 / (high - low))
    if probe.dtype == np.float32:
        values[~np.isfinite(values)] = np.float32(0.5)
    np.clip(values, 0, 1, out=values)
    values -= values.mean()
    length = float(np.sqrt(np.dot(values, values)))
    return values / np.float32(length) if length > 0 else None
