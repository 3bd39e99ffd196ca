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

"""Frames of a sequence, changed when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol
import zlib

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.trackers.code_version import sources_digest

FRAMES_PER_SECOND = 30


class Change(Protocol):
    """A change to the images of a sequence; a small value, since it goes to other processes."""

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        """Return a new image for frame `frame`, always the same one; `image` stays as it is."""


@dataclass(frozen=True)
class Unchanged:
    """No change: the challenge lies in the order of the frames."""

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        """Return the image itself."""
        return image


class ChangedFrames:
    """
    Frames of a sequence, in an order of their own and each of them changed.

    Parameters
    ----------
    sequence : TrackingSequence
        Where the images come from.
    order : sequence of int
        For each frame, the index of its image in the sequence.
    change : Change
        What is done to each image.
    label : str
        Name of the challenge.

    """

    def __init__(self, sequence: TrackingSequence, order: Sequence[int], change: Change,
                 label: str) -> None:
        """Keep the recipe; nothing is decoded yet."""
        self._sequence = sequence
        self._order = tuple(int(index) for index in order)
        self._change = change
        self._label = label
        self._held: tuple[int, npt.NDArray] | None = None

    @property
    def signature(self) -> str:
        """Fingerprint of the sequence, with the challenge and the version of its code."""
        sources = tuple(sorted(Path(__file__).parent.glob('*.py')))
        order = zlib.crc32(repr(self._order).encode())
        return f'{self._sequence.fingerprint}|{self._label}|{order}|{sources_digest(sources)}'

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._order)

    def __getitem__(self, index: int) -> npt.NDArray:
        """Return frame `index`, changed."""
        if not 0 <= index < len(self._order):
            raise IndexError(index)
        return self._change(self._image(self._order[index]), index)

    def __getstate__(self) -> dict:
        """Leave the image in memory behind when the sequence goes to another process."""
        return {**self.__dict__, '_held': None}

    def _image(self, index: int) -> npt.NDArray:
        """Return an image; a video would start again to show the same one twice."""
        if self._held is None or self._held[0] != index:
            self._held = index, self._sequence.frames[index]
        return self._held[1]


def generator(seed: int, frame: int = 0) -> np.random.Generator:
    """Return the source of all that is accidental in one frame of a sequence."""
    return np.random.default_rng((seed, frame))


def seed_of(sequence: TrackingSequence) -> int:
    """Return a seed that depends on the name of the sequence only."""
    return zlib.crc32(sequence.full_name.encode())
