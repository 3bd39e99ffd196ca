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

"""What speaks for a detection, and what comes of it."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.types import TrackState

__all__ = ['Assessment', 'Evidence', 'JUMP', 'Verdict']

JUMP = 1.0
"""Distance from the expected place, in sides of the target, from which a move is a jump."""


@dataclass(frozen=True)
class Evidence:
    """
    What speaks for a detection.

    Attributes
    ----------
    sharpness : float
        Peak-to-sidelobe ratio of the score.
    likeness : float
        What the filter of the first frame says of the peak, as a part of what it says of the
        target there.
    presence : float or None
        Log-odds, by the network that measures the extent, that the target of the first frame
        is there; None where nothing measures.
    jump : float
        Distance, in sides of the target, from where it was expected.

    """

    sharpness: float
    likeness: float = 1.0
    presence: float | None = None
    jump: float = 0.0


@dataclass(frozen=True)
class Assessment:
    """
    Evidence, measured against what was usual in the frames before.

    Attributes
    ----------
    evidence : Evidence
        What was measured.
    quality : float
        Sharpness as a part of the reference.
    presence : float or None
        Log-odds of presence, as of a target that the network knows.
    score : float
        Probability that the detection is the target, in [0, 1].

    """

    evidence: Evidence
    quality: float
    presence: float | None
    score: float


@dataclass(frozen=True)
class Verdict:
    """
    What a frame was judged to be.

    Attributes
    ----------
    score : float
        Probability that the frame shows the target, in [0, 1].
    state : TrackState
        State after the frame.
    believed : bool
        Whether the box moves to what was detected.
    learns : bool
        Whether the filter learns from it.

    """

    score: float
    state: TrackState
    believed: bool
    learns: bool
