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

"""The target is gone for a while, jumps, or has a twin."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import (
    ChangedFrames, FRAMES_PER_SECOND, generator, seed_of, Unchanged)
from lmsco_ros.evaluation.challenges.regions import with_copy, without_region
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import Array, is_absent

# Frames that a tracker gets before and after what happens.
LEAD = 20

_TWIN_NEAR, _TWIN_FAR = 1.6, 3.0
_TWIN_PERIODS = 97, 61
_CROSSING_SPEED = 0.15


@dataclass(frozen=True, eq=False)
class _Erase:
    """Takes the target out of the frames from `start` to before `end`."""

    boxes: Array
    start: int
    end: int
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        box = self.boxes[frame]
        if not self.start <= frame < self.end or not np.isfinite(box).all():
            return image
        return without_region(image, box, generator(self.seed, frame))


def disappear(sequence: TrackingSequence, seconds: float) -> TrackingSequence:
    """
    Take the target out of the middle of the sequence and put background in its place.

    The true box is absent meanwhile.
    """
    duration = round(seconds * FRAMES_PER_SECOND)
    start = _middle(sequence, duration)
    truth = sequence.ground_truth.copy()
    truth[start:start + duration] = np.nan
    erase = _Erase(sequence.ground_truth, start, start + duration, seed_of(sequence))
    frames = ChangedFrames(sequence, range(len(sequence)), erase, f'disappear {seconds}')
    return replace(sequence, frames=frames, ground_truth=truth)


def cut(sequence: TrackingSequence) -> TrackingSequence:
    """
    Leave out the frames after which the target is farthest from where it was.

    The cut comes after a third of the sequence and takes at most another third. A target
    that does not get further than its own size in that time makes no challenge.
    """
    start = len(sequence) // 3
    truth = sequence.ground_truth
    ends = np.arange(start + 1, max(2 * start, start + 2))
    centers = truth[:, :2] + truth[:, 2:] / 2
    distances = np.linalg.norm(centers[ends] - centers[start - 1], axis=1)
    size = np.sqrt(np.prod(truth[start - 1, 2:]))
    if start < LEAD or not np.nanmax(np.append(distances, -np.inf)) > size:
        raise SequenceError('the target does not move by its own size between one and two '
                            'thirds of the sequence, so a cut would not make it jump')
    end = int(ends[np.nanargmax(distances)])
    kept = np.r_[:start, end:len(sequence)]
    attributes = {name: flags[kept] for name, flags in sequence.attributes.items()}
    frames = ChangedFrames(sequence, kept, Unchanged(), 'cut')
    return replace(sequence, frames=frames, ground_truth=truth[kept], attributes=attributes)


@dataclass(frozen=True, eq=False)
class _Twin:
    """Puts a copy of the target at an offset (x, y) from it."""

    boxes: Array
    offsets: Array

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        box = self.boxes[frame]
        if not np.isfinite(box).all():
            return image
        return with_copy(image, box, self.offsets[frame])


def twin(sequence: TrackingSequence) -> TrackingSequence:
    """
    Let a copy of the target swing beside it, now nearer, now farther.

    It stays on the side where the image has more room, 1.6 to 3 sizes away, and moves up and
    down by as much. The true box stays that of the first one.
    """
    rng = generator(seed_of(sequence))
    width, height = np.nanmedian(sequence.ground_truth[:, 2:], axis=0)
    middle = np.nanmedian(sequence.ground_truth[:, 0]) + width / 2
    side = 1 if middle < sequence.frames[0].shape[1] / 2 else -1
    frames = np.arange(len(sequence))
    swing, breath = (np.sin(rng.uniform(0, 2 * np.pi) + 2 * np.pi * frames / period)
                     for period in _TWIN_PERIODS)
    angle = np.pi / 4 * swing
    distance = _TWIN_NEAR + (0.5 + 0.5 * breath) * (_TWIN_FAR - _TWIN_NEAR)
    distance *= max(width, np.sqrt(width * height))
    offsets = distance[:, None] * np.stack([side * np.cos(angle), np.sin(angle)], axis=1)
    return replace(sequence, frames=ChangedFrames(
        sequence, frames.tolist(), _Twin(sequence.ground_truth, offsets), 'twin'))


def twin_crosses(sequence: TrackingSequence) -> TrackingSequence:
    """
    Let a copy of the target cross it in the middle of the sequence, on a course of its own.

    It comes from afar, on a line that is drawn by chance, by 0.15 sizes a frame faster than the
    target, covers it when it is there, and goes on. The true box stays that of the first one.
    """
    twin = _Twin(sequence.ground_truth, crossing_offsets(sequence))
    return replace(sequence, frames=ChangedFrames(
        sequence, range(len(sequence)), twin, 'twin_crosses'))


def crossing_offsets(sequence: TrackingSequence) -> Array:
    """Return how far (x, y) from the target its copy is in each frame of `twin_crosses`."""
    angle = generator(seed_of(sequence)).uniform(0, 2 * np.pi)
    size = np.nanmedian(np.sqrt(np.prod(sequence.ground_truth[:, 2:], axis=1)))
    way = _CROSSING_SPEED * size * (np.arange(len(sequence)) - len(sequence) // 2)
    return way[:, None] * np.array([np.cos(angle), np.sin(angle)])


def _middle(sequence: TrackingSequence, duration: int) -> int:
    """Return where so many frames in the middle begin; the target is there before and after."""
    start = (len(sequence) - duration) // 2
    if start < LEAD:
        raise SequenceError(f'{len(sequence)} frames; this challenge needs at least '
                            f'{duration + 2 * LEAD}')
    around = sequence.ground_truth[[start - 1, start + duration]]
    if is_absent(around).any():
        raise SequenceError(f'the target is absent in frame {start - 1} or {start + duration}, '
                            'between which this challenge takes it away')
    return start
