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

"""Files that say in which frames a target cannot be seen, though a box may be given there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.text_file import read_text
from lmsco_ros.evaluation.errors import SequenceError

_FLAGS: Mapping[str, bool] = {'0': False, '1': True}
# GOT-10k tells in eighths how much of the target is seen.
_HIDDEN: Mapping[str, bool] = {str(eighths): eighths == 0 for eighths in range(9)}

# LaSOT tells two reasons, GOT-10k absence and cover.
_FILES: Mapping[str, Mapping[str, bool]] = {
    'full_occlusion.txt': _FLAGS, 'out_of_view.txt': _FLAGS,
    'absence.label': _FLAGS, 'cover.label': _HIDDEN}
VISIBILITY_FILES = tuple(_FILES)


def unseen(folder: Path, frames: int) -> npt.NDArray[np.bool_]:
    """
    Return the frames in which the files of a sequence say that its target is not seen.

    Parameters
    ----------
    folder : Path
        Sequence folder with any of `full_occlusion.txt`, `out_of_view.txt`, `absence.label`
        (1: not seen) and `cover.label` (0 of 8 parts seen).
    frames : int
        Number of frames.

    Returns
    -------
    ndarray, shape (frames,), bool
        All False where there is no such file.

    Raises
    ------
    SequenceError
        When a file has not one value a frame, or another than it may have.

    """
    hidden = np.zeros(frames, dtype=bool)
    for name, meanings in _FILES.items():
        if (folder / name).is_file():
            values = read_flags(folder / name, meanings)
            if len(values) != frames:
                raise SequenceError(f'{name} has {len(values)} values for {frames} frames; '
                                    'expected one a frame')
            hidden |= values
    return hidden


def read_flags(path: Path, meanings: Mapping[str, bool] = _FLAGS) -> npt.NDArray[np.bool_]:
    """
    Return the values of a file, parted by commas or white space.

    Parameters
    ----------
    path : Path
        File of 0 and 1, or of the keys of `meanings`.
    meanings : mapping of str to bool
        What each value stands for.

    Raises
    ------
    SequenceError
        When it holds anything else.

    """
    words = read_text(path).replace(',', ' ').split()
    unknown = set(words) - set(meanings)
    if unknown:
        raise SequenceError(f'{path.name} holds {min(unknown)[:40]!r}; expected one number from '
                            f'{min(meanings)} to {max(meanings)} a frame')
    return np.array([meanings[word] for word in words], dtype=bool)
