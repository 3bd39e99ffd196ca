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

"""When the target counts as lost and as found again."""

from __future__ import annotations

from dataclasses import dataclass

from lmsco_ros.core.config.validation import check_choice, check_range

__all__ = ['PresenceConfig']


@dataclass(frozen=True)
class PresenceConfig:
    """
    When the target counts as lost and as found again.

    Attributes
    ----------
    learn : {'tracking', 'always'}
        Whether the box follows and the filter learns only what is believed, or every frame, as
        in the paper, whatever the state says.
    reference_frames : int
        Frames after the start whose median sharpness is the measure of all later ones.
    uncertain, certain : float
        Score below which TRACKING becomes UNCERTAIN, and from which UNCERTAIN becomes TRACKING
        again.
    lost : float
        Probability that the target is there, even in a part, below which a frame is not
        believed.
    lost_frames : int
        Frames in a row that are not believed until the state is LOST, at the latest: two are
        enough where all speaks against the target, and many where a little does, even if they
        are believed.
    found : float
        Score from which a target is found again, or found where it was not expected; shortly
        after a cut a high probability that a part of it is there will do.
    sharp, alike : float
        Sharpness, as a part of the reference, and score of the first frame's filter, as a part
        of that in the first frame, that a target has to reach for this.
    distractors : bool
        Whether other peaks of the score are remembered, so that they do not take the place of
        a target that vanishes.

    """

    learn: str = 'tracking'
    reference_frames: int = 10
    uncertain: float = 0.3
    certain: float = 0.5
    lost: float = 0.2
    lost_frames: int = 5
    found: float = 0.7
    sharp: float = 0.4
    alike: float = 0.3
    distractors: bool = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_choice(self, 'learn', ('tracking', 'always'))
        check_range(self, 'reference_frames', 1, 1000)
        check_range(self, 'lost', 0, 1)
        check_range(self, 'uncertain', self.lost, 1)
        check_range(self, 'certain', self.uncertain, 1)
        check_range(self, 'found', self.lost, 1)
        check_range(self, 'sharp', 0, 2)
        check_range(self, 'alike', -1, 2)
        check_range(self, 'lost_frames', 1, 1000)
