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

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import copy
from threading import Lock
from typing import Any

import numpy as np

from lmsco_ros.core.backend import limit_threads, select_backend
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.errors import BusyError, ConfigError, ImageError, NotInitializedError
from lmsco_ros.core.imaging.frame import read_frame
from lmsco_ros.core.track import Track
from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.core.weights.loading import load_networks

__all__ = ['LMSCOTracker']


class LMSCOTracker:
    """
    Follows one target through the frames of a thermal camera.

    Parameters
    ----------
    config : TrackerConfig or str
        How to track, or the name of a preset; the preset 'default' unless given.

    Raises
    ------
    ConfigError
        When there is no preset of that name, the configured device is not available, or a
        network does not fit its blocks.
    WeightsError
        When the weights of a network are missing or damaged.
    BusyError
        From every method: when another thread is at work in this tracker. Nothing changes then.

    Notes
    -----
    Images are (H, W) arrays of integers or floating-point numbers, or (H, W, 3) of uint8 (BGR);
    `read_frame` says how they are read. They are not changed, and nothing of them is kept: the
    next frame may come in the same memory.

    `copy.deepcopy` and `pickle` take a tracker with its target: the copy goes on as the original
    does. A pickle is read by the version of this package that has written it.

    """

    def __init__(self, config: TrackerConfig | str | None = None) -> None:
        self.config = _configuration(config)
        self._backend = select_backend(self.config.runtime.device)
        self._networks = load_networks(self.config)
        limit_threads(self.config.runtime.threads)
        self._track: Track | None = None
        self._kind = ''
        self._lock = Lock()

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of everything but the lock, as it is between two calls."""
        with self._alone():
            return copy.deepcopy({name: value for name, value in vars(self).items()
                                  if name != '_lock'})

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Become the tracker whose state this is."""
        vars(self).update(state)
        self._lock = Lock()
        limit_threads(self.config.runtime.threads)

    @property
    def initialized(self) -> bool:
        """Whether there is a target to follow."""
        return self._track is not None

    def initialize(self, image: np.ndarray, box: BoundingBox | Sequence[float] | np.ndarray,
                   time: float | None = None) -> TrackResult:
        """
        Start to follow the target in `box`, in place of a former one.

        Parameters
        ----------
        image : ndarray
            Frame that shows the target.
        box : BoundingBox, or four numbers
            The target in that frame, (x, y, width, height) in pixels. It may reach over the
            border, with a quarter of its area inside, but not be larger than the image.
        time : float, optional
            When the frame was taken, in seconds on any clock; then every frame has a time.

        Returns
        -------
        TrackResult
            The part of the box in the image, with the score map of the filter that was learned
            from it.

        Raises
        ------
        ImageError, BoxError, TimeError
            When nothing can be learned from the box, or the time is no number; a former target
            is kept.

        """
        with self._alone():
            frame = read_frame(image)
            track = Track(self.config, self._backend, self._networks, frame.pixels,
                          BoundingBox.of(box), time)
            self._track, self._kind = track, frame.kind
            return track.result

    def update(self, image: np.ndarray, time: float | None = None) -> TrackResult:
        """
        Find the target in the next frame.

        Parameters
        ----------
        image : ndarray
            Frame of the same size and type as the first one.
        time : float, optional
            When it was taken, in seconds on the clock of the first frame; where frames have no
            times, the motion is told per frame. A time that is not later than that of the frame
            before counts as one frame of 30 a second.

        Raises
        ------
        NotInitializedError
            When there is no target.
        ImageError, TimeError
            When the frame or its time does not fit the first one; the target is kept.

        """
        with self._alone():
            if self._track is None:
                raise NotInitializedError('there is no target; call initialize(image, box) first')
            frame = read_frame(image)
            if frame.kind != self._kind:
                raise ImageError(f'the frame is {frame.kind}, but the target was initialized in '
                                 f'{self._kind}; initialize again')
            return self._track.advance(frame.pixels, time)

    def reset(self) -> None:
        """Forget the target."""
        with self._alone():
            self._track = None

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Refuse what another call would get in the way of."""
        if not self._lock.acquire(blocking=False):
            raise BusyError('the tracker is at work on another call, of a second thread or of a '
                            'signal handler; expected one call at a time: wait for it, or make '
                            'a tracker for each thread. The target is kept')
        try:
            yield
        finally:
            self._lock.release()


def _configuration(given: object) -> TrackerConfig:
    """Return the configuration, or the preset of a name; that called default without one."""
    if isinstance(given, TrackerConfig):
        return given
    if given is None or isinstance(given, str):
        return TrackerConfig.preset('default' if given is None else given)
    remedy = 'from_dict(...)' if isinstance(given, Mapping) else 'from_yaml(path)'
    raise ConfigError(f'the configuration is a {type(given).__name__}; expected a TrackerConfig '
                      f'or the name of a preset: give TrackerConfig.{remedy}')
