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

"""The tracker is started where there is no target: it should say so."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import (
    Change, ChangedFrames, generator, seed_of, Unchanged)
from lmsco_ros.evaluation.challenges.intensities import stored
from lmsco_ros.evaluation.challenges.regions import Box
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent

_FEWEST_FRAMES = 40
_PLACES = 200
# In sizes of the target, from corner to corner: half a size is between the two.
_AWAY_FROM_TARGET = 1.5


@dataclass(frozen=True)
class _Noise:
    """Shows nothing but white noise, new in each frame."""

    mean: float
    deviation: float
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        values = generator(self.seed, frame).normal(self.mean, self.deviation, image.shape[:2])
        return stored(values if image.ndim == 2 else np.repeat(values[..., None], 3, axis=2),
                      image.dtype)


def start_on_noise(sequence: TrackingSequence) -> TrackingSequence:
    """
    Show white noise, with the mean and the deviation of the first image, new in each frame.

    The tracker is started on a box of the target's size and place. There is no target in any
    later frame.
    """
    first = sequence.frames[0]
    known = first[np.isfinite(first)]
    noise = _Noise(float(known.mean()), float(known.std()), seed_of(sequence))
    return _started(sequence, _first_box(sequence), noise, 'start_on_noise')


def start_on_background(sequence: TrackingSequence) -> TrackingSequence:
    """
    Start the tracker on a piece of the first image that does not stand out.

    It has the size of the target and is half of that away from it, or more. Of the places that
    are drawn by chance it is one with little contrast in itself and around, that is like its
    surroundings in mean and contrast. There is nothing to follow in any later frame, though the
    images show what they did.
    """
    target = _first_box(sequence)
    image = sequence.frames[0]
    gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    values: npt.NDArray[np.float64] = gray.astype(np.float64)
    room = np.array(values.shape[::-1]) - 2 * target[2:]
    if (room <= 0).any():
        raise SequenceError('the target is too large for another place of its size')
    corners = target[2:] / 2 + generator(seed_of(sequence)).uniform(0, 1, (_PLACES, 2)) * room
    apart = np.abs((corners - target[:2]) / target[2:]).max(axis=1) >= _AWAY_FROM_TARGET
    boxes = [np.concatenate([corner, target[2:]]) for corner in corners[apart]]
    outstanding = [_standing_out(values, box) for box in boxes]
    if not np.isfinite(outstanding).any():
        raise SequenceError('there is no place away from the target that is not all the same')
    return _started(sequence, boxes[int(np.argmin(outstanding))], Unchanged(),
                    'start_on_background')


def _standing_out(values: npt.NDArray[np.float64], box: Box) -> float:
    """Return by how much a box differs from what is around it; infinite where that is flat."""
    x, y, width, height = np.floor(box).astype(int)
    right, down = width // 2, height // 2
    outer = values[y - down:y + height + down, x - right:x + width + right]
    inside = np.zeros(outer.shape, bool)
    inside[down:down + height, right:right + width] = True
    within, around = outer[inside], outer[~inside]
    if not (np.isfinite(outer).all() and within.std() > 0 and around.std() > 0):
        return np.inf
    return float(abs(within.mean() - around.mean()) / around.std()
                 + abs(np.log(within.std() / around.std())) + around.std() / np.nanstd(values))


def _started(sequence: TrackingSequence, box: Box, change: Change,
             label: str) -> TrackingSequence:
    """Return the sequence with a box in the first frame and no target afterwards."""
    if len(sequence) < _FEWEST_FRAMES:
        raise SequenceError(f'{len(sequence)} frames; this challenge needs at least '
                            f'{_FEWEST_FRAMES}')
    truth = np.full_like(sequence.ground_truth, np.nan)
    truth[0] = box
    frames = ChangedFrames(sequence, range(len(sequence)), change, label)
    return replace(sequence, frames=frames, ground_truth=truth)


def _first_box(sequence: TrackingSequence) -> Box:
    """Return the first true box."""
    return sequence.ground_truth[~is_absent(sequence.ground_truth)][0]
