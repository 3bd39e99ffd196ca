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

"""The recording is cut to another view, in which the target comes up later."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import (
    ChangedFrames, FRAMES_PER_SECOND, generator, seed_of)
from lmsco_ros.evaluation.challenges.presence import LEAD
from lmsco_ros.evaluation.challenges.regions import without_region
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.confidence import RETURN_FRAMES

_EMPTY = 2 * FRAMES_PER_SECOND


@dataclass(frozen=True, eq=False)
class _OtherView:
    """Mirrors the frames from `start` on, and takes the target out of those before `end`."""

    boxes: Array
    start: int
    end: int
    seed: int

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        if frame < self.start:
            return image
        box = self.boxes[frame]
        if frame < self.end and np.isfinite(box).all():
            image = without_region(image, box, generator(self.seed, frame))
        return np.ascontiguousarray(image[:, ::-1])


def cut_other_view(sequence: TrackingSequence) -> TrackingSequence:
    """
    Cut to another view after a third: the mirrored images, for two seconds without the target.

    The true box is absent for that time and that of the mirrored target afterwards.
    """
    start = len(sequence) // 3
    end = start + _EMPTY
    if start < LEAD or len(sequence) < end + RETURN_FRAMES:
        raise SequenceError(f'{len(sequence)} frames; this challenge needs at least '
                            f'{3 * (_EMPTY + RETURN_FRAMES) // 2}')
    if not np.isfinite(sequence.ground_truth[end]).all():
        raise SequenceError(f'the target is absent in frame {end}, in which this challenge '
                            'shows it again')
    truth = sequence.ground_truth.copy()
    truth[start:, 0] = sequence.frames[0].shape[1] - truth[start:, 0] - truth[start:, 2]
    truth[start:end] = np.nan
    view = _OtherView(sequence.ground_truth, start, end, seed_of(sequence))
    frames = ChangedFrames(sequence, range(len(sequence)), view, 'cut_other_view')
    return replace(sequence, frames=frames, ground_truth=truth)
