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

from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.presence.evidence import (
    Assessment, Evidence, JUMP, NOTHING_STANDS_OUT, Verdict)
from lmsco_ros.core.presence.expectation import Expectation
from lmsco_ros.core.presence.trust import belief, log_odds, trust
from lmsco_ros.core.types import TrackState

__all__ = ['PresenceMonitor']

# After a cut the target is likely to be somewhere in the picture, and looks different: score and
# part of the other thresholds that it has to reach, and its least log-odds of presence. By then,
# in frames, it would have been found.
_AFTER_CUT = (0.5, 0.5, -2.0)
_CUT_FRAMES = 100

# Jump, in sides of the target, that leads out of the region in which it was looked for; and how
# far from the first of two frames that agree the second may see it.
_ELSEWHERE, _AGREEING = 2.5, 2.0
# Frames after a target was found again in which a single doubt is enough to give it up.
_PROBATION = 5

# Belief that is enough for a jump, and to find again what has hardly moved; and score, or belief,
# with which what was seen a frame before is found elsewhere at once.
_LIKELY, _OVERWHELMING = 0.5, 0.85
# Score of the first frame from which the target stands out there: all 88 of the train part do, and
# two of as many pieces of empty ground.
_STANDING_OUT = 0.6
# Part of the score that is told where nothing stood out at the start: of the ground on which
# trackers were started, few frames seemed to be surer.
_DOUBTED = 0.5
# Score of a frame that shows nothing, where nothing stood out at the start.
_NOTHING = 0.2
# Belief that speaks neither for a target nor against it, in the long run; and log-odds against it
# in each of as many frames as lead to LOST, that do so whatever is believed.
_LASTING, _WEARING = 0.4, 2.0

# Part of the sharpness that convinces, of a target that is not in the middle of its region.
_HINT = 0.5


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

    def __init__(self, config: PresenceConfig) -> None:
        self.config = config
        self._expectation = Expectation(config.reference_frames)
        self._state = TrackState.TRACKING
        self._misses = 0
        self._against = 0.0
        self._cut = 0
        self._promised = False
        self._probation = 0
        self._doubtful = False

    @property
    def state(self) -> TrackState:
        """State after the last judged frame."""
        return self._state

    @property
    def after_cut(self) -> bool:
        """Whether the view has changed a while ago and the target has not been seen since."""
        return self._cut > 0

    @property
    def hurried(self) -> bool:
        """Whether the target was seen, or the view has changed, so shortly ago that it hurries."""
        return self._misses < self.config.lost_frames or self._just_cut

    def start(self, evidence: Evidence) -> Verdict:
        """
        Decide on the first frame.

        What does not stand out from its surroundings there is followed, but not learned from
        until it does.
        """
        seen = self.assess(evidence)
        stands_out = seen.score >= max(self.config.certain, _STANDING_OUT)
        self._state = TrackState.TRACKING if stands_out else TrackState.UNCERTAIN
        self._doubtful = not stands_out
        return Verdict(seen.score, self._state, believed=True, learns=stands_out,
                       note=self._note())

    def expect_anew(self) -> None:
        """Expect the sharpness of the frames from now on: it is of another filter."""
        self._expectation = Expectation(self.config.reference_frames)

    def note_noise(self, noise: float) -> None:
        """Take note of the noise of the next frame, its deviation in the working range."""
        self._expectation.note_noise(noise)

    def note_cut(self) -> None:
        """Take note that the view has changed: the target has to be found again."""
        self._cut = _CUT_FRAMES

    def assess(self, evidence: Evidence) -> Assessment:
        """Return the evidence, measured against what the scene lets expect."""
        quality = self._expectation.quality(evidence.sharpness)
        likeness = self._expectation.likeness(evidence.likeness)
        if not quality:
            return Assessment(evidence, 0.0, likeness, 0.0, 0.0)
        hints = quality, likeness, evidence.presence, evidence.vagueness
        return Assessment(evidence, quality, likeness, trust(*hints), belief(*hints))

    def believable(self, seen: Assessment) -> bool:
        """Return whether a frame shows the target."""
        return self.config.learn == 'always' or not self._misses_target(seen)

    def convincing(self, seen: Assessment) -> bool:
        """
        Return whether a frame shows the target even where it was not expected.

        Filter, first filter and extent network must agree, each of them; less so after a cut.
        """
        found, part = _AFTER_CUT[:2] if self.after_cut else (1.0, 1.0)
        likely = seen.score >= min(self.config.found, found) or self._overwhelming(seen)
        return (likely and seen.quality >= part * self.config.sharp
                and seen.likeness >= part * self.config.alike
                and (seen.evidence.presence is None or self.present(seen.evidence.presence)))

    def present(self, presence: float) -> bool:
        """Return whether such log-odds of presence may convince."""
        return presence >= (_AFTER_CUT[2] if self.after_cut else 0.0)

    def hints(self, sharpness: float) -> bool:
        """Return whether a score is so sharp that it may convince from nearer by."""
        return self._expectation.quality(sharpness) >= _HINT * self.config.sharp

    def resembles(self, evidence: Evidence) -> bool:
        """Return whether something looks like the target, which itself may stand beside it."""
        likeness = self._expectation.likeness(evidence.likeness)
        score = trust(1.0, likeness, evidence.presence, evidence.vagueness)
        return score >= self.config.uncertain and likeness >= self.config.alike

    def judge(self, seen: Assessment) -> Verdict:
        """
        Decide on a frame: what is told of it, and whether the track follows and learns.

        Where the target has to be found again, two frames that agree are believed, or one that
        is overwhelming; and the first doubt thereafter gives it up. After a cut it is lost until
        then: its place is of a view that is no more.
        """
        found = not self._misses_target(seen)
        agreed, promising = found and self._promised, False
        if found and not agreed and self._needs_another(seen):
            found, promising = False, True
        given_up = not found and self._probation > 0
        worn_out = self._worn_out(seen)
        elsewhere = found and (agreed or seen.evidence.jump > _ELSEWHERE)
        self._misses = 0 if found else self._misses + 1
        self._against = self._against_with(seen)
        self._cut = 0 if found else max(0, self._cut - 1)
        self._probation = (_PROBATION if elsewhere
                           else max(0, self._probation - 1) if found else 0)
        self._promised = promising
        if found:
            self._expectation.learn(seen.evidence.sharpness)
            self._state = (TrackState.TRACKING if seen.score >= self._certain()
                           else TrackState.UNCERTAIN)
            self._doubtful &= self._state is not TrackState.TRACKING
        elif self._state is not TrackState.LOST:
            lost = (given_up or self.after_cut or worn_out
                    or self._misses >= self.config.lost_frames)
            self._state = TrackState.LOST if lost else TrackState.UNCERTAIN
        always = self.config.learn == 'always'
        score = _DOUBTED * seen.score if self._doubtful else seen.score
        return Verdict(score, self._state, believed=found or always, promising=promising,
                       learns=self._state is TrackState.TRACKING or always, note=self._note())

    def _misses_target(self, seen: Assessment) -> bool:
        """Return whether a frame does not show the target, as far as one can tell."""
        near = seen.evidence.jump <= (_AGREEING if self._promised else JUMP)
        if self._promised and not near:
            return True
        if self._promised or self.after_cut or self._needs_another(seen):
            likely = near and seen.belief >= _LIKELY and not self._doubtful
            return not likely and not self.convincing(seen)
        doubted = seen.evidence.jump > JUMP or self._probation > 0
        return (seen.belief < (_LIKELY if doubted else self.config.lost)
                or self._worn_out(seen) or self._doubtful and seen.score < _NOTHING)

    def _worn_out(self, seen: Assessment) -> bool:
        """Return whether too much has spoken against the target, in two frames or in many."""
        return self._against_with(seen) >= self._enough

    def _against_with(self, seen: Assessment) -> float:
        """
        Return what speaks against the target after a frame: a cumulative sum of log-odds.

        As in the test of Page (1954), which is never below 0; of belief and network, the one that
        doubts more, but no frame has more than half of what is enough. What is lost has nothing
        left to be worn out.
        """
        if self._state is TrackState.LOST:
            return 0.0
        against = log_odds(_LASTING) - log_odds(seen.belief)
        if seen.evidence.presence is not None:
            against = max(against, -seen.evidence.presence)
        return max(0.0, self._against + min(against, 0.5 * self._enough))

    @property
    def _enough(self) -> float:
        """What speaks against a target until it is lost."""
        return _WEARING * self.config.lost_frames

    def _needs_another(self, seen: Assessment) -> bool:
        """
        Return whether another frame has to agree.

        Not with what stayed through a cut, nor where all speaks for what was just seen.
        """
        if self._state is TrackState.LOST:
            return True
        farthest = JUMP if self.after_cut else _ELSEWHERE
        overwhelming = self._overwhelming(seen) and self.convincing(seen)
        return seen.evidence.jump > farthest and not overwhelming

    def _overwhelming(self, seen: Assessment) -> bool:
        """
        Return whether hardly anything but the target is likely to look like this.

        Shortly after a cut a part of it is enough, which is about as likely to be in the picture
        as before; but what did not stand out at the start has no parts.
        """
        sure = seen.belief if self._just_cut and not self._doubtful else seen.score
        return sure >= max(_OVERWHELMING, self.config.found)

    @property
    def _just_cut(self) -> bool:
        """Whether the view has changed in one of the last frames, and it was not seen since."""
        return self._cut > _CUT_FRAMES - self.config.lost_frames

    def _note(self) -> str:
        """Return what is told of a start that nothing has stood out from since."""
        return NOTHING_STANDS_OUT if self._doubtful else ''

    def _certain(self) -> float:
        """
        Return the score from which the state is TRACKING.

        It is less for one that already is, and more where nothing stood out at the start.
        """
        if self._probation:
            return float('inf')
        if self._doubtful:
            return self.config.found
        tracking = self._state is TrackState.TRACKING
        return self.config.uncertain if tracking else self.config.certain
