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

"""Targets that one caller at a time may follow; each frame is measured once for all of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import copy
from threading import Lock
from typing import Any

import numpy as np

from lmsco_ros.core.backend import Backend, limit_threads, select_backend
from lmsco_ros.core.config import TrackerConfig
from lmsco_ros.core.errors import BusyError, ConfigError, ImageError
from lmsco_ros.core.extent.pointing import extent_at
from lmsco_ros.core.imaging.frame import Frame, read_frame
from lmsco_ros.core.imaging.gain import AutomaticGain, FrameSurvey, survey
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import side_by_side
from lmsco_ros.core.track import Track
from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.core.weights.loading import load_networks, Networks

__all__ = ['ConfiguredTargets', 'Targets']


class Targets:
    """
    Any number of tracks, by numbers that grow and are never used again.

    Parameters
    ----------
    config : TrackerConfig
        How to track.
    backend : Backend
        Where the filters are computed.
    networks : Networks
        What the configuration asks for.

    """

    def __init__(self, config: TrackerConfig, backend: Backend, networks: Networks) -> None:
        self._config = config
        self._backend = backend
        self._networks = networks
        self._tracks: dict[int, Track] = {}
        self._kind = ''
        self._started = 0

    def __len__(self) -> int:
        return len(self._tracks)

    @property
    def ids(self) -> tuple[int, ...]:
        """Numbers of the targets, in the order of their starts."""
        return tuple(self._tracks)

    @property
    def results(self) -> dict[int, TrackResult]:
        """What was last said of each target."""
        return {number: track.result for number, track in self._tracks.items()}

    def start(self, image: np.ndarray, box: BoundingBox | Sequence[float] | np.ndarray,
              time: float | None = None, in_place_of: Collection[int] = ()) -> int:
        """
        Start on a target and return its number.

        Parameters
        ----------
        image : ndarray
            Frame that shows the target.
        box : BoundingBox, or four numbers
            The target in it.
        time : float, optional
            When it was taken, in seconds; None where frames have no times.
        in_place_of : collection of int
            Targets that are dropped for it, once it is there.

        Raises
        ------
        ImageError, BoxError, TimeError
            When nothing can be learned from the box, or the frame or its time does not fit those
            of the targets that stay; nothing changes.

        """
        target = BoundingBox.of(box)
        return self._begin(image, time, in_place_of, lambda surveyed: target)

    def start_at(self, image: np.ndarray, point: Sequence[float],
                 time: float | None = None, in_place_of: Collection[int] = ()) -> int:
        """
        Start on what stands out at a point of a frame and return its number.

        Parameters
        ----------
        image : ndarray
            Frame that shows the target.
        point : sequence of float
            Image position (x, y) in pixels.
        time, in_place_of
            As for `start`.

        Raises
        ------
        PointError
            When nothing stands out at the point; nothing changes, as with the errors of `start`.
        ConfigError
            When the configuration names no network that measures extents.

        """
        network = self._networks.extent
        if network is None:
            raise ConfigError('the configuration names no network that measures the extent of '
                              "what is at a point; set extent.network to 'extent', or give a box")

        def box_at(surveyed: FrameSurvey) -> BoundingBox:
            condition = AutomaticGain(self._config.intensity).examine(surveyed)
            return extent_at(network, FrameView(surveyed.image, condition.intensity), point)
        return self._begin(image, time, in_place_of, box_at)

    def advance(self, image: np.ndarray, time: float | None = None,
                only: Collection[int] | None = None) -> dict[int, TrackResult]:
        """
        Find targets in their next frame.

        Parameters
        ----------
        image : ndarray
            The frame.
        time : float, optional
            When it was taken, in seconds; None where frames have no times.
        only : collection of int, optional
            The targets whose next frame it is; all unless given.

        Raises
        ------
        ImageError, TimeError
            When the frame or its time does not fit the ones before; the targets are kept.

        """
        frame = read_frame(image)
        self._check(frame, time, self._tracks.values())
        surveyed = survey(frame.pixels, self._config.intensity)
        headings = {number: track.course.heading for number, track in self._tracks.items()
                    if track.result.state is not TrackState.LOST}
        return side_by_side({
            number: track.advance(surveyed, time, [
                place for other, place in headings.items() if other != number])
            for number, track in self._tracks.items() if only is None or number in only})

    def learn(self) -> None:
        """Learn from the last frame what the next one would wait for."""
        for track in self._tracks.values():
            track.learn()

    def drop(self, number: int) -> None:
        """Forget a target; KeyError when there is none of that number."""
        del self._tracks[number]

    def clear(self) -> None:
        """Forget all targets."""
        self._tracks = {}

    def _begin(self, image: np.ndarray, time: float | None, in_place_of: Collection[int],
               find: Callable[[FrameSurvey], BoundingBox]) -> int:
        """Follow what is found in a frame, in place of others; return its number."""
        frame = read_frame(image)
        staying = {number: track for number, track in self._tracks.items()
                   if number not in in_place_of}
        if staying:
            self._check(frame, time, staying.values())
        surveyed = survey(frame.pixels, self._config.intensity)
        track = Track(self._config, self._backend, self._networks, surveyed, find(surveyed), time)
        self._started += 1
        self._tracks, self._kind = {**staying, self._started: track}, frame.kind
        return self._started

    def _check(self, frame: Frame, time: float | None, tracks: Iterable[Track]) -> None:
        """Refuse a frame of another size or type than those before, or of no fitting time."""
        for track in tracks:
            track.course.check_time(time)
        if frame.kind != self._kind:
            raise ImageError(f'the frame is {frame.kind}, but the target was initialized in '
                             f'{self._kind}; initialize again')


class ConfiguredTargets:
    """
    Targets that one caller at a time may follow.

    Parameters and errors are those of :class:`~lmsco_ros.core.tracker.LMSCOTracker`.
    """

    def __init__(self, config: TrackerConfig | str | None = None) -> None:
        self.config = _configuration(config)
        backend = select_backend(self.config.runtime.device)
        self._targets = Targets(self.config, backend, load_networks(self.config))
        limit_threads(self.config.runtime.threads)
        self._lock = Lock()

    def learn(self) -> None:
        """
        Learn from the last frame, where it is time to: what the next `update` would begin with.

        Who passes results on at once, and waits for the next frame then, calls this in between:
        the results of the next frame are the same, but come earlier.

        Raises
        ------
        BusyError
            When another thread is at work in this tracker. Nothing changes then.

        """
        with self._alone():
            self._targets.learn()

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
