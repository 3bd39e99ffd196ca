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

"""Is the target there? A state machine that judges each frame by its evidence."""

from __future__ import annotations

from dataclasses import dataclass, field
import math

import numpy as np

from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.presence.evidence import Assessment, Evidence, JUMP, Verdict
from lmsco_ros.core.presence.trust import trust
from lmsco_ros.core.types import TrackState

__all__ = ['PresenceMonitor']

# Log-odds that the network gives a target like those of its training, and the part of the way
# that the measure of another target follows in one frame.
_USUAL_PRESENCE = 4.0
_USUAL_RATE = 0.1

# After a cut the target is likely to be somewhere in the picture, and looks different: score and
# part of the other thresholds that it has to reach, and its least log-odds of presence. By then,
# in frames, it would have been found.
_AFTER_CUT = (0.8, 0.5, -2.0)
_CUT_FRAMES = 100


@dataclass
class PresenceMonitor:
    """
    Judges each frame by its evidence, against the first frames of the track.

    :meth:`assess` weighs what may be the target and changes nothing; :meth:`judge` decides on
    the frame, once.

    Parameters
    ----------
    config : PresenceConfig
        Thresholds.

    """

    config: PresenceConfig
    _first: list[float] = field(default_factory=list)
    _usual: float = _USUAL_PRESENCE
    _reference: float | None = None
    _state: TrackState = TrackState.TRACKING
    _misses: int = 0
    _cut: int = 0

    @property
    def state(self) -> TrackState:
        """State after the last judged frame."""
        return self._state

    @property
    def after_cut(self) -> bool:
        """Whether the view has changed a while ago and the target has not been seen since."""
        return self._cut > 0

    def assess(self, evidence: Evidence) -> Assessment:
        """Return the evidence, measured against the frames before."""
        quality, presence = self._quality(evidence.sharpness), self._presence(evidence.presence)
        score = trust(quality, evidence.likeness, presence) if quality else 0.0
        return Assessment(evidence, quality, presence, score)

    def believable(self, seen: Assessment) -> bool:
        """Return whether a frame shows the target."""
        return self.config.learn == 'always' or not self._misses_target(seen)

    def convincing(self, seen: Assessment) -> bool:
        """
        Return whether a frame shows the target even where it was not expected.

        Filter, first filter and extent network must agree, each of them; less so after a cut.
        """
        found, part, present = _AFTER_CUT if self.after_cut else (1.0, 1.0, 0.0)
        return (seen.score >= min(self.config.found, found)
                and seen.quality >= part * self.config.sharp
                and seen.evidence.likeness >= part * self.config.alike
                and (seen.presence is None or seen.presence >= present))

    def resembles(self, evidence: Evidence) -> bool:
        """Return whether something looks like the target, which itself may stand beside it."""
        score = trust(1.0, evidence.likeness, self._presence(evidence.presence))
        return score >= self.config.uncertain and evidence.likeness >= self.config.alike

    def note_cut(self) -> None:
        """Take note that the view has changed: the target has to be found again."""
        self._cut = _CUT_FRAMES

    def judge(self, seen: Assessment) -> Verdict:
        """Decide on a frame: what is told of it, and whether the track follows and learns."""
        believed, missed = self.believable(seen), self._misses_target(seen)
        self._misses = self._misses + 1 if missed else 0
        self._cut = max(0, self._cut - 1) if missed else 0
        if not missed:
            self._state = (TrackState.TRACKING if seen.score >= self._certain()
                           else TrackState.UNCERTAIN)
            self._set_reference(seen.evidence)
        elif self._state is not TrackState.LOST:
            lost = self._misses >= self.config.lost_frames
            self._state = TrackState.LOST if lost else TrackState.UNCERTAIN
        learns = self._state is TrackState.TRACKING or self.config.learn == 'always'
        return Verdict(seen.score, self._state, believed, learns)

    def _quality(self, sharpness: float) -> float:
        """Return the sharpness as a part of the reference; 1 as long as there is none."""
        if not math.isfinite(sharpness) or sharpness <= 0:
            return 0.0
        return sharpness / self._reference if self._reference else 1.0

    def _presence(self, measured: float | None) -> float | None:
        """
        Return the log-odds of presence, as of a target that the network knows.

        A target unlike those of the training, or one that slowly turns, has low odds while it is
        followed with certainty; only what falls below that speaks against it.
        """
        return None if measured is None else measured + max(0.0, _USUAL_PRESENCE - self._usual)

    def _misses_target(self, seen: Assessment) -> bool:
        """Return whether a frame does not show the target, as far as one can tell."""
        if self.after_cut or self._state is TrackState.LOST:
            return not self.convincing(seen)
        jumped = seen.evidence.jump > JUMP
        return seen.score < (self.config.uncertain if jumped else self.config.lost)

    def _set_reference(self, evidence: Evidence) -> None:
        """Take a frame that shows the target into what later frames are measured against."""
        if evidence.sharpness > 0 and len(self._first) < self.config.reference_frames:
            self._first.append(evidence.sharpness)
            self._reference = float(np.median(self._first))
        if evidence.presence is not None and self._state is TrackState.TRACKING:
            self._usual += _USUAL_RATE * (evidence.presence - self._usual)

    def _certain(self) -> float:
        """Return the score from which the state is TRACKING: less for one that already is."""
        tracking = self._state is TrackState.TRACKING
        return self.config.uncertain if tracking else self.config.certain
