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

"""How sharp a score map is, and whether a frame shows the target."""

from __future__ import annotations

from dataclasses import dataclass, field
import math

import numpy as np

from lmsco_ros.core.config import ConfidenceConfig
from lmsco_ros.core.trust import trust
from lmsco_ros.core.types import TrackState

__all__ = ['ConfidenceMonitor', 'Evidence', 'peak_to_sidelobe_ratio']

_JUMP = 1.0


def peak_to_sidelobe_ratio(grid: np.ndarray, exclude: int) -> float:
    """
    Return (maximum - mean) / standard deviation, the latter two away from the peak.

    Parameters
    ----------
    grid : ndarray, shape (n, n)
        Scores, periodic.
    exclude : int
        Half side, in grid points, of the square around the peak that is not sidelobe.

    Notes
    -----
    Bolme et al., MOSSE, CVPR 2010.

    """
    size = grid.shape[0]
    row, column = np.unravel_index(np.argmax(grid), grid.shape)
    around = np.arange(-exclude, exclude + 1)
    values = grid.astype(np.float64)
    square = values[((row + around) % size)[:, None], (column + around) % size]
    count = values.size - square.size
    mean = (values.sum() - square.sum()) / count
    power = (np.vdot(values, values) - np.vdot(square, square)) / count
    deviation = math.sqrt(max(power - mean**2, 0.0))
    return float((grid[row, column] - mean) / deviation) if deviation > 0 else 0.0


# Log-odds that the network gives a target like those of its training, and the part of the way
# that the measure of another target follows in one frame.
_USUAL_PRESENCE = 4.0
_USUAL_RATE = 0.03

# After a cut the target is likely to be somewhere in the picture, and looks different: score and
# part of the other thresholds that it has to reach, and its least log-odds of presence. By then,
# in frames, it would have been found.
_AFTER_CUT = (0.8, 0.5, -2.0)
_CUT_FRAMES = 100


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
        Log-odds, by comparison with the first frame, that the target is there; None where
        nothing is compared.
    jump : float
        Distance, in sides of the target, from where it was expected.

    """

    sharpness: float
    likeness: float = 1.0
    presence: float | None = None
    jump: float = 0.0


@dataclass
class ConfidenceMonitor:
    """
    Judges each frame by its evidence, against the first frames of the track.

    Parameters
    ----------
    config : ConfidenceConfig
        Thresholds.

    """

    config: ConfidenceConfig
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

    @property
    def learns(self) -> bool:
        """Whether the last judged frame is one to learn from."""
        return self._state is TrackState.TRACKING or self.config.learn == 'always'

    def quality(self, sharpness: float) -> float:
        """Return the sharpness as a part of the reference; 1 as long as there is none."""
        if not math.isfinite(sharpness) or sharpness <= 0:
            return 0.0
        return sharpness / self._reference if self._reference else 1.0

    def presence(self, evidence: Evidence) -> float | None:
        """
        Return the log-odds of presence, as of a target that the network knows.

        A target unlike those of the training, or one that slowly turns, has low odds while it is
        followed with certainty; only what falls below that speaks against it.
        """
        if evidence.presence is None:
            return None
        return evidence.presence + max(0.0, _USUAL_PRESENCE - self._usual)

    def score(self, evidence: Evidence) -> float:
        """Return the probability that a frame shows the target, in [0, 1]."""
        quality = self.quality(evidence.sharpness)
        return trust(quality, evidence.likeness, self.presence(evidence)) if quality else 0.0

    def convincing(self, evidence: Evidence) -> bool:
        """
        Return whether a frame shows the target even where it was not expected.

        Filter, first filter and comparison must agree, each of them; less so after a cut.
        """
        presence = self.presence(evidence)
        found, part, present = _AFTER_CUT if self.after_cut else (1.0, 1.0, 0.0)
        return (self.score(evidence) >= min(self.config.found, found)
                and self.quality(evidence.sharpness) >= part * self.config.sharp
                and evidence.likeness >= part * self.config.alike
                and (presence is None or presence >= present))

    def cut(self) -> None:
        """Take note that the view has changed: the target has to be found again."""
        self._cut = _CUT_FRAMES

    def believable(self, evidence: Evidence) -> bool:
        """Return whether a frame shows the target."""
        if self.config.learn == 'always':
            return True
        return not self._misses_target(evidence)

    def beyond_doubt(self, evidence: Evidence) -> bool:
        """Return whether the target was just seen, and a frame shows it where it is expected."""
        return (self._state is TrackState.TRACKING and not self.after_cut
                and evidence.jump <= _JUMP and self.score(evidence) >= self.config.uncertain)

    def similar(self, evidence: Evidence) -> bool:
        """Return whether something looks like the target; the target itself may stand beside."""
        return (trust(1.0, evidence.likeness, self.presence(evidence)) >= self.config.uncertain
                and evidence.likeness >= self.config.alike)

    def judge(self, evidence: Evidence) -> TrackState:
        """Take note of a frame and return the state after it."""
        score = self.score(evidence)
        missed = self._misses_target(evidence)
        self._misses = self._misses + 1 if missed else 0
        self._cut = max(0, self._cut - 1) if missed else 0
        if not missed:
            self._state = (TrackState.TRACKING if score >= self._certain()
                           else TrackState.UNCERTAIN)
            self._set_reference(evidence)
        elif self._state is not TrackState.LOST:
            lost = self._misses >= self.config.lost_frames
            self._state = TrackState.LOST if lost else TrackState.UNCERTAIN
        return self._state

    def _misses_target(self, evidence: Evidence) -> bool:
        """Return whether a frame does not show the target, as far as one can tell."""
        if self.after_cut or self._state is TrackState.LOST:
            return not self.convincing(evidence)
        jumped = evidence.jump > _JUMP
        return self.score(evidence) < (self.config.uncertain if jumped else self.config.lost)

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
