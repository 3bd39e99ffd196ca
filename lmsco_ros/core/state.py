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

"""Position, velocity and size of a target, with their covariance: a Kalman filter."""

from __future__ import annotations

import math
from numbers import Real
import reprlib

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.errors import TimeError
from lmsco_ros.core.types import BoundingBox

__all__ = ['FrameClock', 'TargetState']

_Array = npt.NDArray[np.float64]

# Found on the train part of benchmarks/thermal_dev.yaml, with boxes of the preset default: the
# errors of what was predicted 10 to 90 frames ahead, and of what was measured, are as told.
# Lengths are in sides of the target, times in frames.
_MANEUVER = 6e-3
_FADING = 300.0
_SIZE_CHANGE = 5e-3
# Deviation of the velocity of a target that was just found.
_START_SPEED = 0.1
# Of a size that is given for the truth.
_START_SIZE = 0.02
# Squared distance of a measurement, in deviations, from which it continues no motion.
_JUMP = 25.0
# Errors of center and size that all measurements share, and none averages out: those of the box
# at the start, and of what holds on to it. In sides where nothing measures edges; otherwise in
# deviations of these. With them .77 and .97 of the edges are within one and two deviations on
# clips that the network never saw, and .63 and .88 in rendered sequences.
_LASTING = np.array([0.055, 0.055, 0.15, 0.15])
_LASTING_OF_EDGES = np.array([0.8, 0.8, 1.8, 1.8])

_FRAMES_PER_SECOND = 30.0

_PLACE, _SIZE, _SPEED = slice(0, 2), slice(2, 4), slice(4, 6)


class FrameClock:
    """
    Turns the times of frames into steps of the filter, in frames of a camera of 30 Hz.

    Parameters
    ----------
    time : float or None
        When the first frame was taken, in seconds; None where frames have no times.

    Raises
    ------
    TimeError
        When it is no finite number.

    """

    def __init__(self, time: float | None = None) -> None:
        self._last = _checked(time)

    @property
    def rate(self) -> float:
        """Frames in the unit of time: of a second, or 1 where frames have no times."""
        return 1.0 if self._last is None else _FRAMES_PER_SECOND

    def check(self, time: float | None) -> float | None:
        """
        Return the time of a frame.

        Raises
        ------
        TimeError
            When the time is no finite number, or only one of this frame and the first has one.

        """
        now = _checked(time)
        if (now is None) != (self._last is None):
            has, had = ('no', 'one') if now is None else ('a', 'none')
            raise TimeError(f'the frame has {has} time, but the target was initialized on a frame '
                            f'with {had}; give the time of every frame, or of none')
        return now

    def step(self, time: float | None) -> float:
        """
        Return how many frames have passed since the last one.

        A frame that is not later than the last one has come back to where a recording began, or
        has a stamp that says nothing: one frame has passed.

        Raises
        ------
        TimeError
            As :meth:`check`; nothing changes then.

        """
        now = self.check(time)
        if now is None or self._last is None:
            return 1.0
        passed = now - self._last
        self._last = now
        return _FRAMES_PER_SECOND * passed if passed > 0 else 1.0


def _checked(time: object) -> float | None:
    """Return a time that is a number of seconds, or None."""
    if time is None:
        return None
    try:
        seconds = math.nan if type(time) is bool or not isinstance(time, Real) else float(time)
    except OverflowError:
        seconds = math.inf
    if not math.isfinite(seconds):
        raise TimeError(f'the time of the frame is {reprlib.repr(time)}; expected a finite number '
                        'of seconds, such as stamp.sec + 1e-9 * stamp.nanosec')
    return seconds


class TargetState:
    """
    Kalman filter over the center, size and velocity of a target.

    Parameters
    ----------
    box : BoundingBox
        The target in the first frame.

    Notes
    -----
    The state is (x, y, log w, log h, dx/dt, dy/dt), in pixels and frames. The velocity is
    constant but for maneuvers, white noise of acceleration that grows with the target's side:
    near targets move by more pixels. It fades within ten seconds, so that what is expected of a
    target that is long gone has bounds. Sizes are logarithms, since they change by parts of
    themselves, and remain positive. Measurement update in Joseph's form; Bar-Shalom, Li,
    Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, 5.2 and 6.2.

    """

    _mean: _Array
    _covariance: _Array

    def __init__(self, box: BoundingBox) -> None:
        self._lasting = _LASTING
        self._start(box, np.zeros((2, 2)))

    @property
    def box(self) -> BoundingBox:
        """Where the target is; its center may lie outside of the image."""
        x, y = self._mean[_PLACE].tolist()
        width, height = np.exp(self._mean[_SIZE]).tolist()
        return BoundingBox.from_center((x, y), (width, height))

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity (x, y) in pixels per frame."""
        x, y = self._mean[_SPEED].tolist()
        return x, y

    @property
    def velocity_covariance(self) -> npt.NDArray[np.float64]:
        """Covariance of the velocity in (px per frame)^2, shape (2, 2)."""
        return self._covariance[_SPEED, _SPEED].copy()

    @property
    def covariance(self) -> npt.NDArray[np.float64]:
        """Covariance of center x, center y, width and height in px^2, shape (4, 4)."""
        width, height = np.exp(self._mean[_SIZE]).tolist()
        pixels = np.array([1.0, 1.0, width, height])
        covariance = self._covariance[:4, :4] * (pixels * pixels[:, None])
        covariance.flat[::5] += (self._lasting * (width, height, width, height))**2
        return covariance

    def predict(self, frames: float) -> None:
        """Let so many frames pass; the covariance grows."""
        left = math.exp(-frames / _FADING)
        move = np.eye(6)
        move[_PLACE, _SPEED] = _FADING * (1 - left) * np.eye(2)
        move[_SPEED, _SPEED] = left * np.eye(2)
        self._mean = move @ self._mean
        self._covariance = _symmetric(move @ self._covariance @ move.T) + self._noise(frames)

    def carry(self, shift: npt.NDArray[np.float64]) -> None:
        """Take note that all of the view has moved by a shift (x, y) in pixels."""
        self._mean[_PLACE] += shift

    def measure(self, box: BoundingBox, covariance: npt.NDArray[np.float64],
                edges: npt.NDArray[np.float64] | None = None) -> None:
        """
        Take where the target was seen.

        What is too far from where it was expected continues no motion: all begins anew there.

        Parameters
        ----------
        box : BoundingBox
            Measured in the frame that was predicted last.
        covariance : ndarray, shape (2, 2) or (4, 4)
            Of its center, or of center x, center y, width and height, in px^2; without the size
            only the center is taken.
        edges : ndarray, shape (2,), optional
            Deviations of the measured edges along x and y in px: the less exactly they are seen,
            the larger are the errors that no further measurement averages out. None where
            nothing measures edges.

        """
        self._lasting = (_LASTING if edges is None else
                         _LASTING_OF_EDGES * np.tile(edges / box.size, 2))
        count = len(covariance)
        measured, noise = _measurement(box, covariance)
        surprise = measured - self._mean[:count]
        spread = self._covariance[:count, :count] + noise
        place = surprise[_PLACE]
        if place @ np.linalg.solve(spread[_PLACE, _PLACE], place) > _JUMP:
            self._start(box, covariance)
            return
        gain = np.linalg.solve(spread, self._covariance[:count]).T
        rest = np.eye(6)
        rest[:, :count] -= gain
        self._mean = self._mean + gain @ surprise
        self._covariance = _symmetric(
            rest @ self._covariance @ rest.T + gain @ noise @ gain.T)

    def forget_place(self, image_size: tuple[int, int]) -> None:
        """Take note that the view has changed: the target may be anywhere, at rest."""
        self._mean[_SPEED] = 0.0
        self._covariance[_PLACE] = self._covariance[_SPEED] = 0.0
        self._covariance[:, _PLACE] = self._covariance[:, _SPEED] = 0.0
        self._covariance[_PLACE, _PLACE] = np.diag(np.square(image_size) / 12)
        self._covariance[_SPEED, _SPEED] = _START_SPEED**2 * self.box.area * np.eye(2)

    def _start(self, box: BoundingBox, covariance: npt.NDArray[np.float64]) -> None:
        """Begin anew at a box, with a velocity that nobody knows."""
        count = len(covariance)
        self._mean = np.array([*box.center, *np.log(box.size), 0.0, 0.0])
        self._covariance = np.zeros((6, 6))
        self._covariance[_SIZE, _SIZE] = _START_SIZE**2 * np.eye(2)
        self._covariance[_SPEED, _SPEED] = _START_SPEED**2 * box.area * np.eye(2)
        self._covariance[:count, :count] = _measurement(box, covariance)[1]

    def _noise(self, frames: float) -> _Array:
        """
        Return the covariance of what maneuvers add in so many frames.

        That of an integrated Ornstein-Uhlenbeck process, so that two steps add what one of their
        length does.
        """
        gone = -math.expm1(-frames / _FADING)
        power = _MANEUVER**2 * self.box.area * _FADING / 2
        noise = np.zeros((6, 6))
        way = 2 * (frames / _FADING - gone) - gone**2
        noise[_SIZE, _SIZE] = _SIZE_CHANGE**2 * frames * np.eye(2)
        noise[_PLACE, _PLACE] = power * _FADING**2 * max(way, 0.0) * np.eye(2)
        noise[_PLACE, _SPEED] = noise[_SPEED, _PLACE] = power * _FADING * gone**2 * np.eye(2)
        noise[_SPEED, _SPEED] = power * gone * (2 - gone) * np.eye(2)
        return noise


def _symmetric(matrix: _Array) -> _Array:
    """Return a matrix without what rounding has made different above and below the diagonal."""
    return (matrix + matrix.T) / 2


def _measurement(box: BoundingBox, covariance: _Array) -> tuple[_Array, _Array]:
    """Return a measured box, or its center, and its covariance as the state has them."""
    count = len(covariance)
    units = np.array([1.0, 1.0, *box.size])[:count]
    return (np.array([*box.center, *np.log(box.size)])[:count],
            covariance / np.outer(units, units))
