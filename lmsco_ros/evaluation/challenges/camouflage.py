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

"""The target fades into its surroundings while it goes on moving."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import ChangedFrames, generator, seed_of
from lmsco_ros.evaluation.challenges.intensities import stored
from lmsco_ros.evaluation.challenges.regions import without_region
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.geometry import Array

_CONTRAST = 0.25
_FADING_FRAMES = 15


@dataclass(frozen=True, eq=False)
class _Fade:
    """Mixes what is in the box with its surroundings, more and more from `start` on."""

    boxes: Array
    start: int
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        box = self.boxes[frame]
        faded = min(max((frame - self.start + 1) / _FADING_FRAMES, 0), 1)
        if faded == 0 or not np.isfinite(box).all():
            return image
        surroundings = without_region(image, box, generator(self.seed, frame)).astype(np.float32)
        left = 1 - faded * (1 - _CONTRAST)
        return stored(surroundings + left * (image - surroundings), image.dtype)


def camouflage(sequence: TrackingSequence) -> TrackingSequence:
    """
    Let the target fade to a quarter of its contrast to its surroundings after a third.

    It does so within half a second, and goes on moving: what it looks like says little any more.
    The noise of the surroundings is put in the place of what is taken away.
    """
    fade = _Fade(sequence.ground_truth, len(sequence) // 3, seed_of(sequence))
    return replace(sequence, frames=ChangedFrames(
        sequence, range(len(sequence)), fade, 'camouflage'))
