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

"""One sequence: frames that are read when asked for, and what is true in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
import hashlib

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.frames import FrameSource
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent


@dataclass(frozen=True)
class Origin:
    """
    The whole sequence that a part was taken from.

    Attributes
    ----------
    full_name : str
        Its group and name.
    frames : int
        Its number of frames.

    """

    full_name: str
    frames: int


@dataclass(frozen=True, eq=False)
class TrackingSequence:
    """
    Frames with one target and its true boxes.

    Attributes
    ----------
    name, group : str
        Names of the sequence folder and of the folder around it.
    frames : FrameSource
        Images, decoded one at a time.
    ground_truth : ndarray, shape (n, 4), float64
        True boxes (x, y, width, height), 0-based; NaN rows where the target is absent.
    attributes : mapping of str to ndarray, shape (n,), bool
        Which frames show camera motion, occlusion and so on; empty where unknown.
    challenge : str
        What the sequence was made harder with; empty for a sequence as it was recorded.
    origin : Origin or None
        The whole sequence that this is a part of; None for one that is whole.
    other_truth : ndarray, shape (n, 4), or None
        Boxes that are as true: those of the visible channel, which differ where the two are not
        aligned. Trackers are not started on them.

    """

    name: str
    group: str
    frames: FrameSource
    ground_truth: npt.NDArray[np.float64]
    attributes: Mapping[str, npt.NDArray[np.bool_]] = field(default_factory=dict)
    challenge: str = ''
    origin: Origin | None = None
    other_truth: npt.NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        """Refuse frames and ground truth that do not belong together."""
        if len(self.frames) < len(self.ground_truth):
            raise SequenceError(
                f'{self.full_name}: {len(self.frames)} frames but {len(self.ground_truth)} rows '
                'of ground truth; both must have the same number')
        if is_absent(self.ground_truth).all():
            raise SequenceError(f'{self.full_name}: no frame has a ground-truth box')

    def __len__(self) -> int:
        """Return the number of frames that are evaluated."""
        return len(self.ground_truth)

    @property
    def full_name(self) -> str:
        """Group and name, which together identify a sequence within a dataset."""
        return f'{self.group}/{self.name}'

    @property
    def fingerprint(self) -> str:
        """Digest of the frames' identity and of the ground truth, 16 hexadecimal digits."""
        digest = hashlib.sha256(self.full_name.encode())
        digest.update(self.frames.signature.encode())
        digest.update(np.ascontiguousarray(self.ground_truth).tobytes())
        for name in sorted(self.attributes):
            digest.update(name.encode() + self.attributes[name].tobytes())
        return digest.hexdigest()[:16]

    def first(self, count: int) -> TrackingSequence:
        """Return the sequence cut to its first `count` frames."""
        attributes = {name: flags[:count] for name, flags in self.attributes.items()}
        other = None if self.other_truth is None else self.other_truth[:count]
        return replace(self, ground_truth=self.ground_truth[:count], attributes=attributes,
                       other_truth=other)
