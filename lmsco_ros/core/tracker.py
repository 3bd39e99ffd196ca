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

"""
The LMSCO tracker: one frame's way from image to box.

image -> intensity -> patches -> feature series -> score -> peak -> box, and every few frames
memory -> collaborative optimization -> filter.
"""

from __future__ import annotations

import numpy as np

from lmsco_ros.core.backend import limit_threads, select_backend
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.errors import ImageError, NotInitializedError
from lmsco_ros.core.imaging.frame import check_image
from lmsco_ros.core.track import Track
from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.core.weights.loading import load_networks

__all__ = ['LMSCOTracker']


class LMSCOTracker:
    """
    Follows one target through the frames of a thermal camera.

    Parameters
    ----------
    config : TrackerConfig
        How to track; `TrackerConfig.preset('default')` unless given.

    Raises
    ------
    ConfigError
        When the configured device is not available, or a network does not fit its blocks.
    WeightsError
        When the weights of a network are missing or damaged.

    Notes
    -----
    Images are (H, W) arrays of uint8, uint16 or float32, or (H, W, 3) of uint8 (BGR). They are
    neither copied nor changed.

    """

    def __init__(self, config: TrackerConfig | None = None) -> None:
        self.config = config or TrackerConfig.preset('default')
        self._backend = select_backend(self.config.runtime.device)
        self._networks = load_networks(self.config)
        limit_threads(self.config.runtime.threads)
        self._track: Track | None = None

    @property
    def initialized(self) -> bool:
        """Whether there is a target to follow."""
        return self._track is not None

    def initialize(self, image: np.ndarray, box: BoundingBox) -> TrackResult:
        """
        Start to follow the target in `box`, in place of a former one.

        Parameters
        ----------
        image : ndarray
            Frame that shows the target.
        box : BoundingBox
            The target in that frame.

        Returns
        -------
        TrackResult
            The box itself, with the score map of the filter that was learned from it.

        Raises
        ------
        ImageError, BoxError
            When nothing can be learned from the box; a former target is kept.

        """
        check_image(image)
        self._track = Track(self.config, self._backend, self._networks, image, box)
        return self._track.result

    def update(self, image: np.ndarray) -> TrackResult:
        """
        Find the target in the next frame.

        Parameters
        ----------
        image : ndarray
            Frame of the same size and type as the first one.

        Raises
        ------
        NotInitializedError
            When there is no target.
        ImageError
            When the frame does not fit the first one; the target is kept.

        """
        if self._track is None:
            raise NotInitializedError('there is no target; call initialize(image, box) first')
        check_image(image)
        if image.shape != self._track.image_shape or image.dtype != self._track.image_type:
            raise ImageError(
                f'the frame is {image.shape} {image.dtype}, but the target was initialized in '
                f'{self._track.image_shape} {self._track.image_type}; initialize again')
        return self._track.advance(image)

    def reset(self) -> None:
        """Forget the target."""
        self._track = None
