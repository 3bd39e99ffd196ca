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

_LARGEST_WINDOW = 0.6
_SMALLEST_SIDE = 48
_TARGETS_WIDE = 3
_FOLLOWED_FRAMES = 31
_VISIBLE_SHARE = 0.25
_GAP = 0.5


@dataclass(frozen=True)
class _Pan:
    """
    How the window turns away from the target.

    Attributes
    ----------
    label : str
        Name of the challenge.
    frames : int
        Frames that it takes to turn away, and as many to come back.
    away : int
        Frames between the two.
    to_the_end : bool
        Whether it goes as far as the image allows, or until the target is just outside.

    """

    label: str
    frames: int
    away: int
    to_the_end: bool


_LEAVE = _Pan('leave', 20, FRAMES_PER_SECOND, to_the_end=True)
_LEAVE_EDGE = _Pan('leave_edge', 30, 3 * FRAMES_PER_SECOND // 2, to_the_end=False)


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
    return _panned(sequence, _LEAVE)


def leave_edge(sequence: TrackingSequence) -> TrackingSequence:
    """
    Let the target leave slowly over the edge of the picture, stay behind it, and come back.

    A window as in :func:`leave` pans within 30 frames until the target is half its size
    outside, follows it there for one second and a half, and pans back as slowly.
    """
    return _panned(sequence, _LEAVE_EDGE)


def _panned(sequence: TrackingSequence, pan: _Pan) -> TrackingSequence:
    """Return the part of each image that a window shows which turns away from the target."""
    start = (len(sequence) - pan.away) // 2
    if start < LEAD + pan.frames:
        raise SequenceError(f'{len(sequence)} frames; this challenge needs at least '
                            f'{pan.away + 2 * (LEAD + pan.frames)}')
    shape = sequence.frames[0].shape
    image = np.array([shape[1], shape[0]])
    known = _filled(sequence.ground_truth)
    axis, far, share = _way_out(known[start:start + pan.away], image)
    size = np.floor(image * share).astype(int)
    if (size < np.maximum(_TARGETS_WIDE * known[0, 2:], _SMALLEST_SIDE)).any():
        raise SequenceError('the target is too large, or too much in the middle, for a part of '
                            'the image that it can leave')
    room = image - size
    follow = np.clip(_smooth(known[:, :2] + known[:, 2:] / 2) - size / 2, 0, room)
    turned = _turned_away(len(sequence), start, pan)[:, None]
    away = follow.copy()
    away[:, axis] = room[axis] if far else 0
    if not pan.to_the_end:
        away[:, axis] = np.clip(_beyond(known, size, far)[:, axis], 0, room[axis])
    corners = np.rint((1 - turned) * follow + turned * away).astype(int)
    truth = _seen(sequence.ground_truth - np.pad(corners, ((0, 0), (0, 2))), size)
    frames = ChangedFrames(sequence, range(len(sequence)),
                           _Window(corners, (int(size[0]), int(size[1]))), pan.label)
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


def _beyond(boxes: Array, size: npt.NDArray[np.int_], far: bool) -> Array:
    """Return the corners of windows that end half a target before it, or begin behind it."""
    gap = _GAP * boxes[:, 2:]
    return _smooth(boxes[:, :2] + boxes[:, 2:] + gap if far else boxes[:, :2] - gap - size)


def _turned_away(count: int, start: int, pan: _Pan) -> Array:
    """Return how far the camera has turned away in each frame, from 0 to 1 smoothly."""
    frames = np.arange(count)
    ramp = np.minimum(frames - (start - pan.frames),
                      start + pan.away + pan.frames - 1 - frames) / pan.frames
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
