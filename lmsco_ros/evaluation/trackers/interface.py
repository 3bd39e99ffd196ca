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

"""What the evaluation expects of a tracker, and of a recipe to build one."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy.typing as npt

from lmsco_ros.core import BoundingBox, TrackState


class Answer(NamedTuple):
    """
    A tracker's answer to one frame.

    Attributes
    ----------
    box : BoundingBox or None
        Where the target is; None where the tracker does not say.
    score : float or None
        Trust in the box, higher is better; None for trackers without a score.
    state : TrackState
        What the tracker believes.
    predicted_box : BoundingBox or None
        Where it takes the target to be, also while that is lost; None for trackers without it.
    covariance : ndarray, shape (4, 4), or None
        Of center x, center y, width and height of `predicted_box`, in px^2.

    """

    box: BoundingBox | None
    score: float | None
    state: TrackState
    predicted_box: BoundingBox | None = None
    covariance: npt.NDArray | None = None


class EvaluatedTracker(Protocol):
    """
    A tracker of one target.

    Attributes
    ----------
    in_process : bool
        Whether it computes in this process, so that the process's CPU time is its own.

    """

    in_process: bool

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start on `box` in `image`, forgetting any earlier target."""

    def update(self, image: npt.NDArray) -> Answer:
        """Return where the target is in the next frame."""

    def close(self) -> None:
        """Release processes and files, if there are any."""


class TrackerSpec(Protocol):
    """Recipe for a tracker: small, picklable, built anew in every worker process."""

    @property
    def name(self) -> str:
        """Name in tables and folders."""

    @property
    def identity(self) -> str:
        """Text that changes whenever settings or code of the tracker change."""

    def build(self) -> EvaluatedTracker:
        """Return a new tracker; raise `TrackerError` where that is impossible here."""
