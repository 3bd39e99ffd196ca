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

"""What an uncooled sensor adds to the scene: blur, pattern, drift and noise."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt


class Sensor:
    """
    A microbolometer array that turns scene counts into raw 16-bit frames.

    Parameters
    ----------
    shape : (int, int)
        Height and width, in pixels.
    noise : float
        Standard deviation of the noise of one pixel over time, in counts.
    pattern : float
        Standard deviation of the fixed pattern (columns and single pixels), in counts.
    rng : numpy.random.Generator
        Source of the noise.

    """

    def __init__(self, shape: tuple[int, int], noise: float, pattern: float,
                 rng: np.random.Generator) -> None:
        self._shape = shape
        self._rng = rng
        columns = rng.standard_normal((1, shape[1]), dtype=np.float32)
        pixels = rng.standard_normal(shape, dtype=np.float32)
        # Equal parts, so that their sum has the wanted strength.
        self._pattern = np.float32(pattern * math.sqrt(0.5)) * (columns + pixels)
        # Fresh noise for each frame costs more than all the rest; each frame takes
        # another window of one larger field instead, mirrored at random.
        pool = (shape[0] + shape[0] // 2 + 1, shape[1] + shape[1] // 2 + 1)
        self._noise = np.float32(noise) * rng.standard_normal(pool, dtype=np.float32)

    def expose(self, scene: npt.NDArray[np.float32], time: float) -> npt.NDArray[np.uint16]:
        """
        Return the raw frame of `scene` (H, W), in counts, at `time` in seconds.

        The optics blur by 0.6 pixels; the offset of the whole frame drifts by some
        counts over a minute, as the housing warms up.
        """
        frame = np.asarray(cv2.GaussianBlur(scene, (5, 5), 0.6), np.float32)
        frame += self._pattern
        frame += self._draw_noise()
        frame += np.float32(0.5 + 12 * math.sin(2 * math.pi * time / 60))
        return np.clip(frame, 0, 65535, out=frame).astype(np.uint16)

    def _draw_noise(self) -> npt.NDArray[np.float32]:
        height, width = self._shape
        top = self._rng.integers(self._noise.shape[0] - height + 1)
        left = self._rng.integers(self._noise.shape[1] - width + 1)
        window = self._noise[top:top + height, left:left + width]
        return window[::self._rng.choice((-1, 1)), ::self._rng.choice((-1, 1))]
