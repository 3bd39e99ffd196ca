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

"""The camera pans until the target has left the picture, and comes back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import ChangedFrames, FRAMES_PER_SECOND
from lmsco_ros.evaluation.challenges.presence import LEAD
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import Array, clip_boxes, is_absent

_AWAY = FRAMES_PER_SECOND
_PAN = 20
_LARGEST_WINDOW = 0.6
_SMALLEST_SIDE = 48
_TARGETS_WIDE = 3
_FOLLOWED_FRAMES = 31
_VISIBLE_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class _Window:
    """Shows a part of each image, of one size, from a corner (x, y) that moves."""

    corners: npt.NDArray[np.int_]
    size: tuple[int, int]

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        x, y = self.corners[frame]
        return np.ascontiguousarray(image[y:y + self.size[1], x:x + self.size[0]])


def leave(sequence: TrackingSequence) -> TrackingSequence:
    """
    Pan a window over the images so that the target leaves it for a second and comes back.

    The window follows the target loosely, pans away in the middle of the sequence within
    20 frames and back as fast. The true box is absent where less than a quarter of it is in
    the window. A target too large to be left behind makes no challenge.
    """
    start = (len(sequence) - _AWAY) // 2
    if start < LEAD + _PAN:
        raise SequenceError(f'{len(sequence)} frames; this challenge needs at least '
                            f'{_AWAY + 2 * (LEAD + _PAN)}')
    shape = sequence.frames[0].shape
    image = np.array([shape[1], shape[0]])
    known = _filled(sequence.ground_truth)
    axis, far, share = _way_out(known[start:start + _AWAY], image)
    size = np.floor(image * share).astype(int)
    if (size < np.maximum(_TARGETS_WIDE * known[0, 2:], _SMALLEST_SIDE)).any():
        raise SequenceError('the target is too large, or too much in the middle, for a part of '
                            'the image that it can leave')
    room = image - size
    follow = np.clip(_smooth(known[:, :2] + known[:, 2:] / 2) - size / 2, 0, room)
    turned = _turned_away(len(sequence), start)[:, None]
    away = follow.copy()
    away[:, axis] = room[axis] if far else 0
    corners = np.rint((1 - turned) * follow + turned * away).astype(int)
    truth = _seen(sequence.ground_truth - np.pad(corners, ((0, 0), (0, 2))), size)
    frames = ChangedFrames(sequence, range(len(sequence)),
                           _Window(corners, (int(size[0]), int(size[1]))), 'leave')
    return replace(sequence, frames=frames, ground_truth=truth)


def _way_out(boxes: Array, image: npt.NDArray[np.int_]) -> tuple[int, bool, float]:
    """
    Return where a window gets away from the target.

    Returns
    -------
    axis : int
        0: sideways, 1: up or down.
    far : bool
        Whether at the right or lower end of the image, else at the other one.
    share : float
        Size that the window may have there, as a share of the image.

    """
    low, high = boxes[:, :2].min(axis=0), (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
    rooms = np.concatenate([low / image, 1 - high / image])
    best = int(rooms.argmax())
    return best % 2, best >= 2, float(np.clip(rooms[best], 0, _LARGEST_WINDOW))


def _turned_away(count: int, start: int) -> Array:
    """Return how far the camera has turned away in each frame, from 0 to 1 smoothly."""
    frames = np.arange(count)
    ramp = np.minimum(frames - (start - _PAN), start + _AWAY + _PAN - 1 - frames) / _PAN
    ramp = np.clip(ramp, 0, 1)
    return ramp**2 * (3 - 2 * ramp)


def _filled(truth: Array) -> Array:
    """Return true boxes with those in between where the target is absent."""
    present = np.flatnonzero(~is_absent(truth))
    return np.stack([np.interp(np.arange(len(truth)), present, column[present])
                     for column in truth.T], axis=1)


def _smooth(path: Array) -> Array:
    """Return a path (n, 2) without its fast movements."""
    size = 1, _FOLLOWED_FRAMES
    return np.asarray(cv2.blur(path, size, borderType=cv2.BORDER_REPLICATE), np.float64)


def _seen(truth: Array, size: npt.NDArray[np.int_]) -> Array:
    """Return true boxes with those absent of which too little is in the window."""
    visible = np.prod(clip_boxes(truth, (int(size[0]), int(size[1])))[:, 2:], axis=1)
    shown = visible >= _VISIBLE_SHARE * np.prod(truth[:, 2:], axis=1)
    return np.where(shown[:, None], truth, np.nan)
