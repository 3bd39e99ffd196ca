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

"""What thermal cameras do to their pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import (
    Change, ChangedFrames, generator, seed_of, Unchanged)
from lmsco_ros.evaluation.challenges.intensities import Span, stored
from lmsco_ros.evaluation.datasets import TrackingSequence

SHUTTER_EVERY, SHUTTER_FRAMES = 60, 12
_GAIN_EVERY = 20
_DEAD_SHARE, _DEAD_LINES = 0.003, 2
_TELEMETRY_ROWS = 4
_SPOTS = 6
_COUNTS, _COUNTS_PER_LEVEL, _DRIFT = 7000.0, 2.0, 250.0
_DRIFT_PERIOD = 200


def shutter(sequence: TrackingSequence) -> TrackingSequence:
    """
    Let the picture stand for 12 frames every 60, as during a flat-field correction.

    The scene moves on underneath, so the target jumps afterwards. The true box is that of
    the picture shown.
    """
    frames = np.arange(len(sequence))
    since = frames % SHUTTER_EVERY
    closed = (frames >= SHUTTER_EVERY) & (since < SHUTTER_FRAMES)
    order = np.where(closed, frames - since, frames)
    attributes = {name: flags[order] for name, flags in sequence.attributes.items()}
    return replace(sequence, ground_truth=sequence.ground_truth[order], attributes=attributes,
                   frames=ChangedFrames(sequence, order.tolist(), Unchanged(), 'shutter'))


@dataclass(frozen=True)
class _GainJump:
    """Draws a gain and an offset for every 20 frames; the first ones stay as they are."""

    span: Span
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        if frame < _GAIN_EVERY:
            return image
        rng = generator(self.seed, frame // _GAIN_EVERY)
        gain, offset = rng.uniform(0.5, 1.3), rng.uniform(-0.15, 0.15) * self.span.width
        middle = self.span.middle
        return stored(middle + offset + gain * (image.astype(np.float32) - middle), image.dtype)


def gain_jump(sequence: TrackingSequence) -> TrackingSequence:
    """Let gain (0.5 to 1.3) and offset (15 % of the span at most) jump every 20 frames."""
    return _changed(sequence, _GainJump(Span.of(sequence), seed_of(sequence)), 'gain_jump')


@dataclass(frozen=True)
class _Inversion:
    """Exchanges warm and cold in the frames from `start` to before `end`."""

    span: Span
    start: int
    end: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        if not self.start <= frame < self.end:
            return image
        return stored(self.span.low + self.span.high - image.astype(np.float32), image.dtype)


def polarity(sequence: TrackingSequence) -> TrackingSequence:
    """Switch between white hot and black hot after a third, and back after two thirds."""
    third = len(sequence) // 3
    return _changed(sequence, _Inversion(Span.of(sequence), third, 2 * third), 'polarity')


@dataclass(frozen=True)
class _DeadPixels:
    """Sets single pixels, two rows and two columns to the ends of the scale."""

    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        rng = generator(self.seed)
        ends = _ends(image.dtype)
        height, width = image.shape[:2]
        count = max(1, round(_DEAD_SHARE * height * width))
        result = image.copy()
        for end in ends:
            result[rng.integers(0, height, count // 2), rng.integers(0, width, count // 2)] = end
        for end, row, column in zip(ends, rng.choice(height, _DEAD_LINES, replace=False),
                                    rng.choice(width, _DEAD_LINES, replace=False)):
            result[row], result[:, column] = end, end
        return result


def dead_pixels(sequence: TrackingSequence) -> TrackingSequence:
    """Let 0.3 % of the pixels, two rows and two columns be dead, always the same ones."""
    return _changed(sequence, _DeadPixels(seed_of(sequence)), 'dead_pixels')


@dataclass(frozen=True)
class _Telemetry:
    """Writes noise over the whole scale into the first rows, anew in each frame."""

    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        result = image.copy()
        rows = result[:_TELEMETRY_ROWS]
        low, high = _ends(image.dtype)
        rows[...] = generator(self.seed, frame).uniform(low, high, rows.shape)
        return result


def telemetry(sequence: TrackingSequence) -> TrackingSequence:
    """Put telemetry, which looks like noise, into the four uppermost rows."""
    return _changed(sequence, _Telemetry(seed_of(sequence)), 'telemetry')


@dataclass(frozen=True)
class _NoValue:
    """Makes round spots in float32 images that are not a number, or infinite."""

    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        rng = generator(self.seed, frame)
        result = _gray(image).astype(np.float32)
        for value in (np.nan, np.inf, -np.inf):
            for _ in range(_SPOTS // 3):
                center = rng.uniform((0, 0), result.shape[::-1]).astype(int).tolist()
                spot = np.zeros(result.shape, np.uint8)
                cv2.circle(spot, center, int(rng.integers(1, 6)), 1, cv2.FILLED)
                result[spot > 0] = value
        return result


def no_value(sequence: TrackingSequence) -> TrackingSequence:
    """Turn the images into 32FC1 with spots of NaN and infinity, elsewhere in each frame."""
    return _changed(sequence, _NoValue(seed_of(sequence)), 'nan')


@dataclass(frozen=True)
class _Counts:
    """Maps the span of the images to a few hundred of the 65,536 counts, with drift."""

    span: Span
    phase: float
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        levels = (_gray(image).astype(np.float32) - self.span.low) * (255 / self.span.width)
        drift = _DRIFT * np.sin(self.phase + 2 * np.pi * frame / _DRIFT_PERIOD)
        noise = generator(self.seed, frame).integers(0, 2, levels.shape)
        return stored(_COUNTS + drift + _COUNTS_PER_LEVEL * levels + noise, np.uint16)


def sixteen_bit(sequence: TrackingSequence) -> TrackingSequence:
    """Map the images into 510 counts of 16 bit, which drift up and down by 250."""
    seed = seed_of(sequence)
    phase = float(generator(seed).uniform(0, 2 * np.pi))
    return _changed(sequence, _Counts(Span.of(sequence), phase, seed), 'sixteen_bit')


def _changed(sequence: TrackingSequence, change: Change, label: str) -> TrackingSequence:
    frames = ChangedFrames(sequence, range(len(sequence)), change, label)
    return replace(sequence, frames=frames)


def _ends(dtype: np.dtype) -> tuple[float, float]:
    """Return the values of dead pixels: the ends of the scale, of 16 bit for temperatures."""
    limits = np.iinfo(dtype if np.issubdtype(dtype, np.integer) else np.uint16)
    return float(limits.min), float(limits.max)


def _gray(image: npt.NDArray) -> npt.NDArray:
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
