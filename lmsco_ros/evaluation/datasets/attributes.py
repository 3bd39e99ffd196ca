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

"""Attribute files of the VOT format: one 0 or 1 for each frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.visibility import read_flags, VISIBILITY_FILES
from lmsco_ros.evaluation.errors import SequenceError

# The annotated attributes of VOT-TIR; `empty` marks the frames without any other.
VOT_TIR_ATTRIBUTES = ('camera_motion', 'dynamics_change', 'motion_change', 'occlusion',
                      'size_change', 'empty')
_SUFFIXES = ('.tag', '.label')


def read_attributes(folder: Path, frames: int) -> dict[str, npt.NDArray[np.bool_]]:
    """
    Return the attributes that `folder` annotates.

    Parameters
    ----------
    folder : Path
        Sequence folder with files such as `camera_motion.tag` or `occlusion.label`; those
        that say whether the target is seen at all are no attributes.
    frames : int
        Number of frames; shorter files are continued with 0.

    Returns
    -------
    dict of str to ndarray, shape (frames,), bool
        `empty` is derived from the others where there is no file of that name; the
        dictionary is empty where nothing is annotated.

    Raises
    ------
    SequenceError
        When a file holds anything but 0 and 1, or more values than there are frames.

    """
    attributes = {path.stem: _read(path, frames) for path in sorted(folder.iterdir())
                  if path.suffix in _SUFFIXES and path.name not in VISIBILITY_FILES}
    if attributes and 'empty' not in attributes:
        attributes['empty'] = ~np.any(list(attributes.values()), axis=0)
    return attributes


def _read(path: Path, frames: int) -> npt.NDArray[np.bool_]:
    values = read_flags(path)
    if len(values) > frames:
        raise SequenceError(f'{path.name} has {len(values)} values for {frames} frames; '
                            'expected at most one a frame')
    return np.append(values, np.zeros(frames - len(values), dtype=bool))
