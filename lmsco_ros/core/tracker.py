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
The LMSCO tracker, of one target or several: one frame's way from image to box.

image -> intensity -> patches -> feature series -> score -> peak -> box, and every few frames
memory -> collaborative optimization -> filter.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from lmsco_ros.core.errors import NotInitializedError, UnknownTargetError
from lmsco_ros.core.targets import ConfiguredTargets
from lmsco_ros.core.types import BoundingBox, TrackResult

__all__ = ['LMSCOTracker', 'MultiTracker']


class LMSCOTracker(ConfiguredTargets):
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

    @property
    def initialized(self) -> bool:
        """Whether there is a target to follow."""
        return bool(self._targets)

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
            number = self._targets.start(image, box, time, self._targets.ids)
            return self._targets.results[number]

    def initialize_at(self, image: np.ndarray, point: Sequence[float],
                      time: float | None = None) -> TrackResult:
        """
        Start to follow what stands out from its surroundings at a point, whatever its extent.

        Parameters
        ----------
        image : ndarray
            Frame that shows the target.
        point : sequence of float
            Image position (x, y) on the target, in pixels.
        time : float, optional
            As for `initialize`.

        Raises
        ------
        PointError
            When the point is not in the image, or nothing stands out there; a former target is
            kept, as with the errors of `initialize`.
        ConfigError
            When the configuration names no network that measures extents.

        """
        with self._alone():
            number = self._targets.start_at(image, point, time, self._targets.ids)
            return self._targets.results[number]

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
            if not self._targets:
                raise NotInitializedError('there is no target; call initialize(image, box) first')
            result, = self._targets.advance(image, time).values()
            return result

    def reset(self) -> None:
        """Forget the target."""
        with self._alone():
            self._targets.clear()


class MultiTracker(ConfiguredTargets):
    """
    Follows any number of targets through the frames of a thermal camera.

    Each target is told by its number, its id, which grows from 1 with every start and is never
    used again. What is said of a target is what a tracker of its own says, but that none is
    taken for another one that is known: where they meet, targets keep their numbers. Each frame
    is read and measured once for all.

    Parameters and errors of its making, images, copies and pickles are those of
    :class:`LMSCOTracker`; every method raises `BusyError` as its methods do.
    """

    @property
    def ids(self) -> tuple[int, ...]:
        """Numbers of the targets, in the order of their starts."""
        return self._targets.ids

    @property
    def results(self) -> dict[int, TrackResult]:
        """What was last said of each target, by its number."""
        return self._targets.results

    def initialize(self, image: np.ndarray, box: BoundingBox | Sequence[float] | np.ndarray,
                   time: float | None = None, in_place_of: Collection[int] = ()) -> int:
        """
        Start to follow one more target; the others wait for their next frame.

        Parameters
        ----------
        image, box, time
            As for :meth:`LMSCOTracker.initialize`.
        in_place_of : collection of int
            Targets that are forgotten for it.

        Returns
        -------
        int
            Number of the target; `results` has its first result.

        Raises
        ------
        ImageError, BoxError, TimeError
            When nothing can be learned from the box, or the frame or its time does not fit those
            of the targets that stay; nothing changes.

        """
        with self._alone():
            return self._targets.start(image, box, time, in_place_of)

    def initialize_at(self, image: np.ndarray, point: Sequence[float],
                      time: float | None = None, in_place_of: Collection[int] = ()) -> int:
        """
        Start to follow what stands out from its surroundings at a point, whatever its extent.

        Parameters
        ----------
        image, point
            As for :meth:`LMSCOTracker.initialize_at`.
        time, in_place_of
            As for `initialize`.

        Returns
        -------
        int
            Number of the target; `results` has its first result, with the box that was found.

        Raises
        ------
        PointError, ConfigError
            As :meth:`LMSCOTracker.initialize_at`; nothing changes, as with the errors of
            `initialize`.

        """
        with self._alone():
            return self._targets.start_at(image, point, time, in_place_of)

    def update(self, image: np.ndarray, time: float | None = None,
               only: Collection[int] | None = None) -> dict[int, TrackResult]:
        """
        Find the targets in their next frame.

        Parameters
        ----------
        image : ndarray
            Frame of the same size and type as the first one. Without targets it may be any.
        time : float, optional
            When it was taken, as for :class:`LMSCOTracker`.
        only : collection of int, optional
            Targets whose next frame it is, where one that was started late catches up; all
            unless given.

        Returns
        -------
        dict of int to TrackResult
            What there is to say of each target, by its number.

        Raises
        ------
        ImageError, TimeError
            When the frame or its time does not fit the first one; the targets are kept.

        """
        with self._alone():
            return self._targets.advance(image, time, only) if self._targets else {}

    def drop(self, number: int) -> None:
        """
        Forget a target.

        Raises
        ------
        UnknownTargetError
            When there is none of that number.

        """
        with self._alone():
            if number not in self._targets.ids:
                raise UnknownTargetError(
                    f'there is no target {number}; followed are '
                    + (', '.join(map(str, self._targets.ids)) or 'none'))
            self._targets.drop(number)

    def reset(self) -> None:
        """Forget all targets."""
        with self._alone():
            self._targets.clear()
