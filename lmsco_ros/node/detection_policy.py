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

"""On which of the boxes that a detector has found to start, and when."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import math
from typing import NamedTuple

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState

# A detection that overlaps a target so much is that target.
_SAME = 0.2


class Candidate(NamedTuple):
    """What a detector has found, in pixels of the image that the tracker sees."""

    box: BoundingBox
    score: float
    class_id: str


@dataclass(frozen=True)
class DetectionPolicy:
    """
    Starts where there is room, on what is not followed yet.

    Parameters
    ----------
    choice : str
        Which of several: `highest_score` or `nearest_to_center`.
    classes : frozenset of str
        Only these; empty allows any.
    least_score : float
        Only from this score on.
    restart : bool
        Whether a target that is lost makes room.
    most_targets : int
        There is room for so many.

    """

    choice: str
    classes: frozenset[str]
    least_score: float
    restart: bool
    most_targets: int

    def pick(self, candidates: Iterable[Candidate], results: Mapping[int, TrackResult],
             image_size: tuple[int, int]) -> BoundingBox | None:
        """
        Return the box to start on, None where there is none.

        Parameters
        ----------
        candidates : iterable of Candidate
            What was found in an image.
        results : mapping of int to TrackResult
            What was last said of each target.
        image_size : tuple of int
            Width and height in pixels.

        """
        middle = image_size[0] / 2, image_size[1] / 2

        def rank(candidate: Candidate) -> float:
            if self.choice == 'highest_score':
                return -candidate.score
            return math.dist(candidate.box.center, middle)

        fitting = [candidate for candidate in candidates
                   if candidate.score >= self.least_score
                   and (not self.classes or candidate.class_id in self.classes)
                   and self.wants(candidate.box, results)]
        return min(fitting, key=rank).box if fitting else None

    def wants(self, box: BoundingBox, results: Mapping[int, TrackResult]) -> bool:
        """Return whether to start on a box: there is room, and no target that is seen there."""
        seen = [result for result in results.values() if result.state is not TrackState.LOST]
        taken = len(seen) if self.restart else len(results)
        return taken < self.most_targets and not any(
            result.box.overlap(box) > _SAME for result in seen)
