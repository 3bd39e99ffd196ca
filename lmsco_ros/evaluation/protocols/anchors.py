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

"""
Several starts in each sequence, as in the VOT short-term challenges since 2020.

Kristan et al., "The Eighth Visual Object Tracking VOT2020 Challenge Results" (2020), and
the official toolkit (votchallenge/toolkit, experiment `multistart`). A tracker is started
on frames along a sequence and never helped again. It has failed where its overlap falls to
`FAILURE_OVERLAP` and does not rise above that within `FAILURE_FRAMES` frames; what comes
afterwards counts as overlap 0. Overlap counts inside the image only.

Frames without a target are taken out, since VOT has none. The first frame of a part, where
the true box is given, counts as survived but not for the mean overlap; the toolkit has it
in the mean with overlap 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
import numpy.typing as npt

from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.supervised import Fragment

FAILURE_OVERLAP = 0.1
FAILURE_FRAMES = 10

# Frames, the first one of a part included; in the toolkit, where it is not, 115 and 755.
VOT2020_INTERVAL = (116, 756)

_BORDER_PIXELS = 1.0


@dataclass(frozen=True, eq=False)
class PartOutcome:
    """
    What happened between one start and the end of its part.

    Attributes
    ----------
    fragment : Fragment
        Overlap of each frame with a target before the failure, the start included.
    frames : int
        Number of frames with a target in the whole part.

    """

    fragment: Fragment
    frames: int

    @property
    def survived(self) -> int:
        """Number of frames with a target before the failure; all of them without one."""
        return len(self.fragment.overlaps)

    @property
    def measured(self) -> Array:
        """Overlap of the frames that count for accuracy: before the failure, after the start."""
        return self.fragment.overlaps[1:]


def part_outcome(overlap: Array) -> PartOutcome:
    """
    Return how a part went.

    Parameters
    ----------
    overlap : ndarray, shape (n,)
        Overlap of each frame of the part; NaN where the target is absent.

    """
    present = overlap[np.isfinite(overlap)]
    survived = _survived_frames(present)
    return PartOutcome(Fragment(present[:survived], failed=survived < len(present)),
                       len(present))


def touches_border(boxes: Array, size: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """
    Return which boxes touch the border of the image or leave it.

    Parameters
    ----------
    boxes : ndarray, shape (n, 4)
        Boxes in pixels.
    size : (int, int)
        Width and height of the image in pixels.

    Returns
    -------
    ndarray, shape (n,), bool
        True where less than a pixel lies between the box and a side of the image.

    """
    margins = np.concatenate(
        [boxes[:, :2], np.asarray(size) - (boxes[:, :2] + boxes[:, 2:])], axis=1)
    return margins.min(axis=1) < _BORDER_PIXELS


def _survived_frames(overlap: Array) -> int:
    low = overlap <= FAILURE_OVERLAP
    if len(low) < FAILURE_FRAMES:
        return len(low)
    lasting = sliding_window_view(low, FAILURE_FRAMES).all(axis=1)
    return int(np.argmax(lasting)) if lasting.any() else len(low)
