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

"""How sharp a score map is, and what that says about the target."""

from __future__ import annotations

from dataclasses import dataclass, field
import math

import numpy as np

from lmsco_ros.core.config import ConfidenceConfig
from lmsco_ros.core.types import TrackState

__all__ = ['ConfidenceMonitor', 'Evidence', 'peak_to_sidelobe_ratio']


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
    square = grid[np.ix_((row + around) % size, (column + around) % size)]
    count = grid.size - square.size
    mean = (grid.sum(dtype=np.float64) - square.sum(dtype=np.float64)) / count
    power = (np.square(grid).sum(dtype=np.float64)
             - np.square(square).sum(dtype=np.float64)) / count
    deviation = math.sqrt(max(power - mean**2, 0.0))
    return float((grid[row, column] - mean) / deviation) if deviation > 0 else 0.0


@dataclass(frozen=True)
class Evidence:
    """
    What speaks for a detection.

    Attributes
    ----------
    sharpness : float
        Peak-to-sidelobe ratio of the score.
    presence : float
        Probability, by comparison with the first frame, that the target is there; 1 where
        nothing is compared.

    """

    sharpness: float
    presence: float = 1.0


@dataclass
class ConfidenceMonitor:
    """
    Judges each frame by the sharpness of its scores, against the first frames of the track.

    Parameters
    ----------
    config : ConfidenceConfig
        Thresholds.

    """

    config: ConfidenceConfig
    _reference: list[float] = field(default_factory=list)
    _state: TrackState = TrackState.TRACKING
    _misses: int = 0

    @property
    def state(self) -> TrackState:
        """State after the last judged frame."""
        return self._state

    def quality(self, sharpness: float) -> float:
        """Return the sharpness as a part of the reference; 1 as long as there is none."""
        if not self._reference:
            return float(sharpness > 0)
        return sharpness / float(np.median(self._reference))

    def convincing(self, evidence: Evidence) -> bool:
        """Return whether a frame shows the target even where it was not expected."""
        return (self.quality(evidence.sharpness) >= self.config.found
                and evidence.presence >= self.config.present)

    def believable(self, evidence: Evidence) -> bool:
        """Return whether a frame shows the target."""
        if self._state is TrackState.LOST:
            return self.convincing(evidence)
        return (self.quality(evidence.sharpness) >= self.config.lost
                and evidence.presence >= self.config.absent)

    def judge(self, evidence: Evidence) -> TrackState:
        """Take note of a frame and return the state after it."""
        if self.believable(evidence):
            self._misses = 0
            certain = (self.quality(evidence.sharpness) >= self.config.uncertain
                       and evidence.presence >= self.config.present)
            self._state = TrackState.TRACKING if certain else TrackState.UNCERTAIN
            if evidence.sharpness > 0 and len(self._reference) < self.config.reference_frames:
                self._reference.append(evidence.sharpness)
        else:
            self._misses += 1
            lost = self._state is TrackState.LOST or self._misses >= self.config.lost_frames
            self._state = TrackState.LOST if lost else TrackState.UNCERTAIN
        return self._state

    def score(self, evidence: Evidence) -> float:
        """Return the trust in a frame, in [0, 1): (1 - exp(-2 quality)) times the presence."""
        sharp = 1 - math.exp(-2 * max(self.quality(evidence.sharpness), 0.0))
        return sharp * evidence.presence
