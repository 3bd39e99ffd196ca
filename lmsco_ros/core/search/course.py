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

"""Where a target goes: where it is expected next, and its motion with a covariance."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
import math

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.imaging.gain import FrameSurvey
from lmsco_ros.core.imaging.regions import clamp_box, visible_part
from lmsco_ros.core.search.camera import CameraMotion
from lmsco_ros.core.search.prediction import Prediction
from lmsco_ros.core.state import FrameClock, TargetState
from lmsco_ros.core.types import BoundingBox, TrackResult

__all__ = ['Course']

# Frames in which a target vanishes behind something, or into it.
_BEFORE = 30


class Course:
    """
    The way of one target.

    What is expected of it where it is looked for is short-sighted and comes to rest; its state,
    which is told, goes on.

    Parameters
    ----------
    box : BoundingBox
        The target in the first frame.
    time : float or None
        When that frame was taken, in seconds; None where frames have no times.

    Raises
    ------
    TimeError
        When the time is no finite number.

    """

    def __init__(self, box: BoundingBox, time: float | None) -> None:
        self._clock, self._motion = FrameClock(time), TargetState(box)
        self._prediction, self._camera = Prediction(), CameraMotion()
        self._box, self._moment = box, 0.0
        self._sizes = deque([box.size], maxlen=_BEFORE)
        self._promise: BoundingBox | None = None

    @property
    def heading(self) -> tuple[float, float]:
        """Where (x, y) the target gets to in the next frame, if it goes on as before."""
        (x, y), (right, down) = self._box.center, self._prediction.velocity
        return x + right, y + down

    @property
    def misses(self) -> int:
        """Number of frames since the target was seen."""
        return self._prediction.misses

    @property
    def last(self) -> BoundingBox:
        """The target where it was seen last, in the view of now."""
        return self._box

    @property
    def predicted(self) -> BoundingBox:
        """The target where its motion has led it; its center may lie outside of the image."""
        return self._motion.box

    def check_time(self, time: float | None) -> None:
        """Raise TimeError unless the next frame may have that time."""
        self._clock.check(time)

    def next_frame(self, time: float | None) -> None:
        """Go on to the next frame; TimeError as :meth:`check_time`."""
        passed = self._clock.step(time)
        self._moment += passed
        self._motion.predict(passed)

    def look_around(self, frame: FrameSurvey) -> None:
        """Carry a target that is not seen with what the camera does otherwise than before."""
        shift = self._camera.observe(frame, self._moment, followed=not self.misses)
        if not shift.any():
            return
        self._motion.carry(shift)
        self._box = _carried(self._box, shift)
        self._promise = self._promise and _carried(self._promise, shift)

    def expected(self, image_size: tuple[int, int]) -> BoundingBox:
        """Return where the target is expected next: where the last frame may have shown it."""
        return self._promise or self._prediction.expected(self._box, image_size)

    def follow(self, box: BoundingBox, merged: bool = False) -> None:
        """Take note of the box of the target in this frame, alone or merged with another one."""
        self._box, self._promise = box, None
        self._sizes.append(box.size)
        self._prediction.seen(box.center, merged)

    def measure(self, box: BoundingBox, covariance: npt.NDArray[np.float64],
                measured: Measurement | None) -> None:
        """Take the box, with the covariance of what was measured, into the motion."""
        edges = None if measured is None else measured.deviations.mean(axis=1)
        self._motion.measure(box, covariance, edges)

    def missed(self, promise: BoundingBox | None) -> None:
        """Take note of a frame without the target, or of a place that may have shown it."""
        self._promise = promise
        self._prediction.missed()

    def lost(self) -> None:
        """Take note that it is lost: it is expected in the size before it began to vanish."""
        self._box = BoundingBox.from_center(self._box.center, max(self._sizes, key=math.prod))

    def forget(self, image_size: tuple[int, int]) -> None:
        """Take note that the view has changed: the target may be anywhere, at rest."""
        self._prediction.stop()
        self._camera.forget()
        self._motion.forget_place(image_size)
        self._promise = None

    def describe(self, result: TrackResult, image_size: tuple[int, int]) -> TrackResult:
        """Return a result with what is known of the motion in the same frame."""
        motion, rate = self._motion, self._clock.rate
        x, y = motion.velocity
        return replace(
            result, velocity=(rate * x, rate * y), covariance=motion.covariance,
            predicted_box=visible_part(clamp_box(motion.box, image_size), image_size),
            velocity_covariance=rate**2 * motion.velocity_covariance)


def _carried(box: BoundingBox, shift: npt.NDArray[np.float64]) -> BoundingBox:
    """Return a box that has moved by (x, y) pixels."""
    x, y = (shift + box.center).tolist()
    return box.moved_to((x, y))
