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

__all__ = ['Assessment', 'Evidence', 'JUMP', 'NOTHING_STANDS_OUT', 'Verdict']

JUMP = 1.0
"""Distance from the expected place, in sides of the target, from which a move is a jump."""

NOTHING_STANDS_OUT = 'start: nothing stands out'
"""Said of a target that does not differ from its surroundings where it was started."""


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
    vagueness : float or None
        Mean deviation of the edges that were measured, in sides of the target: large where
        nothing stands out from its surroundings. None where nothing measures.
    jump : float
        Distance, in sides of the target, from where it was expected.

    """

    sharpness: float
    likeness: float = 1.0
    presence: float | None = None
    vagueness: float | None = None
    jump: float = 0.0


@dataclass(frozen=True)
class Assessment:
    """
    Evidence, measured against what the scene lets expect.

    Attributes
    ----------
    evidence : Evidence
        What was measured.
    quality : float
        Sharpness as a part of what is expected.
    likeness : float
        Likeness as a part of what is expected.
    score : float
        Probability that a box there covers the target by more than half, in [0, 1].
    belief : float
        Probability that it is the target, even in a part, in [0, 1].

    """

    evidence: Evidence
    quality: float
    likeness: float
    score: float
    belief: float


@dataclass(frozen=True)
class Verdict:
    """
    What a frame was judged to be.

    Attributes
    ----------
    score : float
        Probability that the box covers the target by more than half, in [0, 1].
    state : TrackState
        State after the frame.
    believed : bool
        Whether the box moves to what was detected.
    learns : bool
        Whether the filter learns from it.
    promising : bool
        Whether it would be believed if the next frame agreed.
    note : str
        What else a person should know; mostly nothing.

    """

    score: float
    state: TrackState
    believed: bool
    learns: bool
    promising: bool = False
    note: str = ''
