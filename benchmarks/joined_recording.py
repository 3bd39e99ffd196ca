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

"""One long recording made of many sequences, with the marks of a person who watches it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.imaging.pixels import to_gray
from lmsco_ros.evaluation.challenges import apply_challenge
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.run_file import SequenceInfo

__all__ = ['Fit', 'FRAMES_PER_SECOND', 'Part', 'join', 'read_truth', 'stamp_of',
           'write_truth']

FRAMES_PER_SECOND = 30
# What happens in one part after the other; where it does not fit, nothing happens.
EVENTS = ('disappear_1s', 'shutter', 'disappear_3s', '')
_SHORTEST = 2 * FRAMES_PER_SECOND
# Readers take a stamp of 0 for none.
_FIRST_STAMP = 10 ** 9


def stamp_of(index: int) -> int:
    """Return the stamp of a frame of the recording, in nanoseconds."""
    return _FIRST_STAMP + index * 10 ** 9 // FRAMES_PER_SECOND


@dataclass(frozen=True)
class Fit:
    """
    Puts images of one size into the middle of a frame of another, in their proportions.

    Attributes
    ----------
    scale : tuple of float
        Factors in x and y; the same but for the rounding to whole pixels.
    size : tuple of int
        Width and height of what the image becomes.
    corner : tuple of int
        Its left upper corner (x, y) in the frame.
    frame : tuple of int
        Width and height of the frame.

    """

    scale: tuple[float, float]
    size: tuple[int, int]
    corner: tuple[int, int]
    frame: tuple[int, int]

    @classmethod
    def of(cls, width: int, height: int, frame: tuple[int, int]) -> Fit:
        """Return the largest fit of an image of this size."""
        scale = min(frame[0] / width, frame[1] / height)
        size = round(width * scale), round(height * scale)
        corner = (frame[0] - size[0]) // 2, (frame[1] - size[1]) // 2
        return cls((size[0] / width, size[1] / height), size, corner, frame)

    def image(self, image: npt.NDArray) -> npt.NDArray:
        """Return the frame, gray; beside the image there is its median."""
        gray = to_gray(image)
        smaller = self.size[0] < gray.shape[1]
        inner = cv2.resize(gray, self.size, interpolation=cv2.INTER_AREA if smaller
                           else cv2.INTER_LINEAR)
        left, top = self.corner
        frame = np.full(self.frame[::-1], np.median(gray), gray.dtype)
        frame[top:top + self.size[1], left:left + self.size[0]] = inner
        return frame

    def boxes(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return where boxes of the image, shape (n, 4), lie in the frame."""
        return boxes * np.tile(self.scale, 2) + np.append(self.corner, (0, 0))


@dataclass(frozen=True, eq=False)
class Part:
    """
    A sequence within the recording.

    Attributes
    ----------
    sequence : TrackingSequence
        With what happens in it.
    fit : Fit
        How its images come into the frames of the recording.

    """

    sequence: TrackingSequence
    fit: Fit

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.sequence)

    @property
    def truth(self) -> npt.NDArray[np.float64]:
        """True boxes (n, 4) in the recording, NaN where the target is absent."""
        return self.fit.boxes(self.sequence.ground_truth)

    @property
    def mark(self) -> BoundingBox:
        """The target in the first frame, as a person would mark it."""
        return BoundingBox(*map(float, self.truth[0]))

    @property
    def info(self) -> SequenceInfo:
        """What figures are made from."""
        return SequenceInfo(self.sequence.name, self.sequence.group, self.fit.frame, self.truth,
                            {}, self.sequence.challenge)

    def images(self) -> Iterator[npt.NDArray]:
        """Yield the frames of the recording."""
        for index in range(len(self)):
            yield self.fit.image(self.sequence.frames[index])


def join(sequences: Sequence[TrackingSequence], frames: int, size: tuple[int, int],
         events: Sequence[str] = EVENTS) -> list[Part]:
    """
    Return the parts of a recording.

    Parameters
    ----------
    sequences : sequence of TrackingSequence
        Played one after the other, and again from the first one on; those that begin without
        their target are left out.
    frames : int
        Length of the recording; a rest of less than two seconds is left out.
    size : tuple of int
        Width and height of its frames.
    events : sequence of str
        Challenges that take turns; empty: nothing happens.

    Raises
    ------
    SequenceError
        When no sequence is fit.

    """
    usable = [item for item in sequences if not is_absent(item.ground_truth[:1]).any()]
    if not usable:
        raise SequenceError('no sequence shows its target in the first frame')
    parts, rest = [], frames
    for number, sequence in enumerate(cycle(usable)):
        if rest < min(_SHORTEST, frames):
            return parts
        part = _with_event(sequence, events[number % len(events)])
        part = part.first(min(rest, len(part)))
        height, width = part.frames[0].shape[:2]
        parts.append(Part(part, Fit.of(width, height, size)))
        rest -= len(part)
    return parts


def _with_event(sequence: TrackingSequence, event: str) -> TrackingSequence:
    """Return the sequence with a challenge, or as it is where that does not fit."""
    if not event:
        return sequence
    try:
        changed = apply_challenge(sequence, event)
    except SequenceError:
        return sequence
    return replace(changed, name=sequence.name)


def write_truth(parts: Sequence[Part], path: Path) -> None:
    """Write one row for each frame; the box is empty where the target is absent."""
    with path.open('w', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(['frame', 'stamp_ns', 'part', 'group', 'name', 'event',
                         'x', 'y', 'width', 'height'])
        index = 0
        for number, part in enumerate(parts):
            name = part.sequence.group, part.sequence.name, part.sequence.challenge
            for box in part.truth:
                shown = [''] * 4 if is_absent(box[None])[0] else box.round(3).tolist()
                writer.writerow([index, stamp_of(index), number, *name, *shown])
                index += 1


def read_truth(path: Path, size: tuple[int, int]) -> list[SequenceInfo]:
    """Return the parts that `write_truth` wrote, in a recording with frames of this size."""
    parts: dict[str, list[dict[str, str]]] = {}
    with path.open(newline='') as file:
        for row in csv.DictReader(file):
            parts.setdefault(row['part'], []).append(row)
    return [SequenceInfo(
        rows[0]['name'], rows[0]['group'], size,
        np.array([[float(row[key] or 'nan') for key in ('x', 'y', 'width', 'height')]
                  for row in rows]), {}, rows[0]['event']) for rows in parts.values()]
