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

"""What sharpness and likeness a target has in the scene as it is now."""

from __future__ import annotations

import math

import numpy as np

__all__ = ['Expectation']

# Noise in the working range that halves the sharpness of a score, and the likeness: by what
# became of both in clips of the train part of benchmarks/thermal_dev.yaml whose contrast was
# lowered and whose noise was raised.
_BLUNTING, _VEILING = 0.05, 0.25


class Expectation:
    """
    Sharpness and likeness that are expected of the target, by its first frames and the noise.

    A camera that stretches its contrast raises the noise with it; both then fall, though the
    target is there. Less noise than in the first frames makes nobody expect more.

    Parameters
    ----------
    frames : int
        How many frames are taken for the reference.

    """

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._first: list[tuple[float, float]] = []
        self._reference: tuple[float, float] | None = None
        self._noise = 0.0

    def note_noise(self, noise: float) -> None:
        """Take note of the noise of a frame, its deviation in the working range."""
        self._noise = noise

    def learn(self, sharpness: float) -> None:
        """Take the sharpness of a frame that shows the target into the reference."""
        if sharpness > 0 and len(self._first) < self._frames:
            self._first.append((sharpness, self._noise))
            sharp, noise = np.median(self._first, axis=0).tolist()
            self._reference = sharp, noise

    def quality(self, sharpness: float) -> float:
        """Return a sharpness as a part of what is expected; 1 as long as nothing is."""
        if not math.isfinite(sharpness) or sharpness <= 0:
            return 0.0
        if self._reference is None:
            return 1.0
        return sharpness / (self._reference[0] * self._left(_BLUNTING))

    def likeness(self, likeness: float) -> float:
        """Return a likeness as a part of what is expected."""
        return likeness / self._left(_VEILING)

    def _left(self, halving: float) -> float:
        """Return the part that is left of what a noise of `halving` halves."""
        first = self._noise if self._reference is None else self._reference[1]
        return min(1.0, (halving + first) / (halving + self._noise))
