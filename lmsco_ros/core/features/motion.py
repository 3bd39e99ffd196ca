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

"""What has moved in the search region since the last frame (paper, section III-A)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from lmsco_ros.core.config import MotionConfig
from lmsco_ros.core.features.optical_flow import DenseFlow, flow_image, global_motion
from lmsco_ros.core.types import BoundingBox

__all__ = ['MotionObserver']


class MotionObserver:
    """
    Remembers a region of the last frame, and compares the next frame with it.

    Parameters
    ----------
    config : MotionConfig
        What counts as motion.

    """

    def __init__(self, config: MotionConfig) -> None:
        self._config = config
        self._flow = DenseFlow()
        self._region: BoundingBox | None = None
        self._patch: np.ndarray | None = None

    def remember(self, region: BoundingBox, patch: np.ndarray) -> None:
        """Take note of what the region, in which the target is expected next, shows now."""
        self._region, self._patch = region, patch

    def images(self, region: BoundingBox, patch: np.ndarray,
               factors: Sequence[float]) -> np.ndarray | None:
        """
        Return a flow image for each scale, or None where nothing can be said of motion.

        Parameters
        ----------
        region : BoundingBox
            Region of the frame at scale 1.
        patch : ndarray, shape (S, S), float32
            What it shows.
        factors : sequence of float
            Scales of the regions that are searched.

        Returns
        -------
        ndarray, shape (n, S, S, 3), float32, or None
            None in the first frame, in another region than the one remembered, after a frozen
            frame, and where nothing moves by itself.

        """
        if self._patch is None or not _alike(region, self._region):
            return None
        flow = self._flow(self._patch, patch)
        if self._config.remove_camera_motion:
            flow = flow - global_motion(flow)
        fastest = float(np.percentile(np.hypot(flow[..., 0], flow[..., 1]), 99))
        if fastest < self._config.least_motion:
            return None
        return np.stack([flow_image(_zoom(flow, factor)) for factor in factors])


def _alike(region: BoundingBox, other: BoundingBox | None) -> bool:
    """Return whether two regions differ by rounding only, as a region scaled by 1 does."""
    return other is not None and bool(np.allclose(
        region.as_tuple(), other.as_tuple(), rtol=0, atol=1e-6 * region.width))


def _zoom(flow: np.ndarray, factor: float) -> np.ndarray:
    """Return the flow that a region `factor` times as large would show, in its own pixels."""
    if factor == 1:
        return flow
    size = flow.shape[0]
    start = size * (1 - factor) / 2 + factor / 2 - 0.5
    inverse = np.array([[factor, 0, start], [0, factor, start]])
    zoomed = cv2.warpAffine(flow, inverse, (size, size),
                            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                            borderMode=cv2.BORDER_REPLICATE)
    return zoomed / np.float32(factor)
