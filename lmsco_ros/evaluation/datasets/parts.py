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

"""Parts of a sequence, tracked forward or backward from frames along it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.frames import FrameSource
from lmsco_ros.evaluation.datasets.sequence import Origin, TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent

ANCHOR_SPACING = 50

# Frames that are decoded at once where a part is read backward.
_BLOCK = 64


@dataclass(frozen=True)
class AnchorPlan:
    """
    Where a tracker is started, and how far it goes from there.

    Attributes
    ----------
    spacing : int
        Frames from one anchor to the next; the first one is frame 0.
    length : int or None
        Frames of a part, all forward. None: to the end or back to the beginning of the
        sequence, whichever is farther, as in VOT2020.

    """

    spacing: int = ANCHOR_SPACING
    length: int | None = None


class PartFrames:
    """
    Some frames of a source, in an order of their own.

    A film going back starts again at its first frame, so a part that is read backward is
    decoded forward in blocks.

    Parameters
    ----------
    whole : FrameSource
        All frames.
    indices : range
        Those of the part.

    """

    def __init__(self, whole: FrameSource, indices: range) -> None:
        """Read nothing yet."""
        self._whole = whole
        self._indices = indices
        self._block: dict[int, npt.NDArray] = {}
        self._last: int | None = None

    @property
    def signature(self) -> str:
        """Text that changes when the frames or their order change."""
        return f'{self._whole.signature}[{self._indices}]'

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._indices)

    def __getitem__(self, index: int) -> npt.NDArray:
        """Return image `index` of the part."""
        number = self._indices[index]
        steps_back = self._last is not None and number == self._last - 1
        self._last = number
        if not steps_back:
            return self._whole[number]
        if number not in self._block:
            first = max(number + 1 - _BLOCK, 0)
            self._block = {place: self._whole[place] for place in range(first, number + 1)}
        return self._block[number]

    def __getstate__(self) -> dict[str, Any]:
        """Leave images behind when the part goes to another process."""
        return {**self.__dict__, '_block': {}, '_last': None}


def anchored_parts(sequence: TrackingSequence, plan: AnchorPlan) -> tuple[TrackingSequence, ...]:
    """
    Return the parts of a sequence that begin at its anchors.

    An anchor at which the target is absent moves to the next frame that shows it, and is
    dropped where there is none, where another one stands already, or where no later frame
    of the part has a target.

    Parameters
    ----------
    sequence : TrackingSequence
        Whole sequence.
    plan : AnchorPlan
        Spacing and length.

    Raises
    ------
    SequenceError
        When no part is left.

    """
    present = np.flatnonzero(~is_absent(sequence.ground_truth))
    wanted = np.arange(0, len(sequence), plan.spacing)
    later = np.searchsorted(present, wanted)
    anchors = np.unique(present[later[later < len(present)]])
    spans = (_span(int(anchor), len(sequence), plan) for anchor in anchors)
    parts = tuple(_part(sequence, span) for span in spans
                  if np.isin(present, list(span)).sum() > 1)
    if not parts:
        raise SequenceError(f'{sequence.full_name}: no start has a later frame with a target')
    return parts


def _span(anchor: int, frames: int, plan: AnchorPlan) -> range:
    """Return the frames of the part that begins at `anchor`."""
    if plan.length is not None:
        return range(anchor, min(anchor + plan.length, frames))
    backward = anchor + 1 > frames - anchor
    return range(anchor, -1, -1) if backward else range(anchor, frames)


def _part(sequence: TrackingSequence, span: range) -> TrackingSequence:
    indices = list(span)
    return replace(
        sequence, name=f'{sequence.name}@{span[0]}-{span[-1]}',
        frames=PartFrames(sequence.frames, span), ground_truth=sequence.ground_truth[indices],
        attributes={name: flags[indices] for name, flags in sequence.attributes.items()},
        origin=Origin(sequence.full_name, len(sequence)))
