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

"""Contrast and noise change from one frame to the next, as when a camera stretches anew."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import ChangedFrames, generator, seed_of
from lmsco_ros.evaluation.challenges.intensities import Span, stored
from lmsco_ros.evaluation.challenges.regions import noise_deviation
from lmsco_ros.evaluation.datasets import TrackingSequence

_LOW_CONTRAST = 0.3
_LOUD = 6.0
# Part of the span that the noise is taken to have at least: compressed films have lost theirs.
_LEAST_NOISE = 1 / 255


@dataclass(frozen=True)
class _Step:
    """Draws the counts together around one of them and makes up the noise that there shall be."""

    contrast: float
    added_noise: float
    middle: float
    start: int
    end: int
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        if not self.start <= frame < self.end:
            return image
        noise = generator(self.seed, frame).normal(0, self.added_noise, image.shape[:2])
        noise = noise if image.ndim == 2 else noise[..., None]
        values = self.middle + self.contrast * (image.astype(np.float32) - self.middle) + noise
        return stored(values, image.dtype)


def noise_step(sequence: TrackingSequence) -> TrackingSequence:
    """Let the noise be six times as strong from the end of the first third on."""
    return _stepped(sequence, 'noise_step', 1.0, _LOUD, len(sequence))


def contrast_step(sequence: TrackingSequence) -> TrackingSequence:
    """Let the contrast fall to 0.3 after a third, at the same noise, and rise after another."""
    return _stepped(sequence, 'contrast_step', _LOW_CONTRAST, 1.0, 2 * (len(sequence) // 3))


def stretch_step(sequence: TrackingSequence) -> TrackingSequence:
    """Let contrast fall and noise rise, as in the other two, at once and for good."""
    return _stepped(sequence, 'stretch_step', _LOW_CONTRAST, _LOUD, len(sequence))


def _stepped(sequence: TrackingSequence, label: str, contrast: float, noise: float,
             end: int) -> TrackingSequence:
    """Return the sequence with another contrast, and so many times the noise, up to `end`."""
    first, span = sequence.frames[0], Span.of(sequence)
    known = np.isfinite(first)
    level = max(noise_deviation(np.where(known, first, span.middle), known),
                _LEAST_NOISE * span.width)
    step = _Step(contrast, level * float(np.sqrt(noise**2 - contrast**2)),
                 float(np.median(first[known])), len(sequence) // 3, end, seed_of(sequence))
    return replace(sequence, frames=ChangedFrames(sequence, range(len(sequence)), step, label))
