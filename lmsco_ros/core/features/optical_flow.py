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

"""Dense optical flow between two patches, and its picture (Danelljan et al., DMSRDCF, 2016)."""

from __future__ import annotations

import cv2
import numpy as np

__all__ = ['DenseFlow', 'FLOW_CHANNELS', 'flow_channels', 'flow_image', 'global_motion']

FLOW_CHANNELS = 3

_SCALE = 16.0
_MIDDLE = 128.0
_FIT_POINTS = 24
_FIT_STEPS = 4


class DenseFlow:
    """
    Dense inverse search on intensities (Kroeger et al., ECCV 2016).

    The working range is fixed by the patches themselves, both with the same, so that a gain of
    the camera does not look like motion.
    """

    def __init__(self) -> None:
        # OpenCV's annotations lack what its video module creates.
        self._search = cv2.DISOpticalFlow_create(  # type: ignore[attr-defined]
            cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)

    def __reduce__(self) -> tuple[type[DenseFlow], tuple[()]]:
        """Copy and pickle by making it anew: OpenCV's object cannot be, and holds nothing."""
        return DenseFlow, ()

    def __call__(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """
        Return how far each pixel of `after` has come from `before`.

        Parameters
        ----------
        before, after : ndarray, shape (S, S), float32
            Intensities in the working range.

        Returns
        -------
        ndarray, shape (S, S, 2), float32
            (u, v) in pixels: `after[y, x]` shows what `before[y - v, x - u]` did.

        """
        return -self._search.calc(_to_bytes(after), _to_bytes(before), None)


def _to_bytes(patch: np.ndarray) -> np.ndarray:
    """Return the patch with its mean and contrast made alike, for 8-bit methods."""
    mean, deviation = cv2.meanStdDev(patch)
    scale = 40.0 / max(float(deviation[0, 0]), 1e-3)
    return cv2.convertScaleAbs(np.clip(
        (patch - np.float32(mean[0, 0])) * np.float32(scale) + 128, 0, 255))


def global_motion(flow: np.ndarray) -> np.ndarray:
    """
    Return the motion that most of the patch shares: an affine fit that outliers do not bend.

    Parameters
    ----------
    flow : ndarray, shape (S, S, 2), float32
        Motion of each pixel.

    Returns
    -------
    ndarray, shape (S, S, 2), float32
        Motion of the fit, by iteratively reweighted least squares with Cauchy weights whose
        width is the median residual.

    """
    size = flow.shape[0]
    step = max(1, size // _FIT_POINTS)
    samples = flow[step // 2::step, step // 2::step].reshape(-1, 2).astype(np.float64)
    axis = (np.arange(size) + 0.5) / size - 0.5
    points = axis[step // 2::step]
    design = np.stack([np.ones(len(samples)), np.tile(points, len(points)),
                       np.repeat(points, len(points))], axis=1)
    model = np.zeros((3, 2))
    model[0] = np.median(samples, axis=0)
    for _ in range(_FIT_STEPS):
        residual = np.linalg.norm(samples - design @ model, axis=1)
        weights = 1 / (1 + (residual / (np.median(residual) + 1e-3))**2)
        weighted = design * weights[:, None]
        model = np.linalg.lstsq(weighted.T @ design, weighted.T @ samples, rcond=None)[0]
    fit = (model[0] + axis[None, :, None] * model[1] + axis[:, None, None] * model[2])
    return fit.astype(np.float32)


def flow_image(flow: np.ndarray) -> np.ndarray:
    """
    Return the flow as a picture for a motion network.

    Parameters
    ----------
    flow : ndarray, shape (S, S, 2), float32
        (u, v) in pixels.

    Returns
    -------
    ndarray, shape (S, S, 3), float32
        u, v and magnitude, each times 16 plus 128, clipped to 0..255.

    """
    magnitude = np.sqrt(np.sum(flow**2, axis=-1, keepdims=True))
    image = np.concatenate([flow, magnitude], axis=-1)
    return np.clip(image * np.float32(_SCALE) + np.float32(_MIDDLE), 0, 255)


def flow_channels(images: np.ndarray, cell: int) -> np.ndarray:
    """
    Return the flow of each cell, as a part of the largest that flow images hold.

    Parameters
    ----------
    images : ndarray, shape (n, S, S, 3), float32
        Flow images; S is a multiple of `cell`.
    cell : int
        Side of a cell in pixels.

    Returns
    -------
    ndarray, shape (n, S // cell, S // cell, 3), float32
        Means of u, v and magnitude.

    """
    count, size = images.shape[:2]
    cells = images.reshape(count, size // cell, cell, size // cell, cell, FLOW_CHANNELS)
    return (cells.mean(axis=(2, 4)) - np.float32(_MIDDLE)) / np.float32(_MIDDLE)
