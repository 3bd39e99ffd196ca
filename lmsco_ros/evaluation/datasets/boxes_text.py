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

"""Ground truth as text: one row of numbers a frame."""

from __future__ import annotations

from pathlib import Path
import re

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.errors import SequenceError

_SEPARATOR = re.compile(r'[,;\s]+')
_ABSENT = (np.nan,) * 4


def read_boxes(path: Path) -> npt.NDArray[np.float64]:
    """
    Return the boxes of a ground-truth file.

    Parameters
    ----------
    path : Path
        Rows of four numbers (x, y, width, height) or of polygon corners
        (x1, y1, x2, y2, ...), separated by commas, semicolons or white space.

    Returns
    -------
    ndarray, shape (n, 4), float64
        A polygon becomes its enclosing upright box, as the VOT toolkit does for trackers
        that report boxes. Rows with `nan`, and boxes without area, become NaN: absent.

    Raises
    ------
    SequenceError
        When the file is empty or a row is not understood.

    """
    lines = path.read_text(encoding='utf-8', errors='replace').splitlines()
    rows = [_box(line, f'{path.name}, line {number}')
            for number, line in enumerate(lines, start=1) if line.strip()]
    if not rows:
        raise SequenceError(f'{path.name} is empty; expected one row of numbers a frame')
    return np.array(rows, dtype=float)


def _box(line: str, where: str) -> tuple[float, ...]:
    try:
        numbers = [float(word) for word in _SEPARATOR.split(line.strip(' ,;\t')) if word]
    except ValueError:
        raise SequenceError(f'{where}: {line.strip()!r} is not a row of numbers') from None
    if not np.isfinite(numbers).all():
        return _ABSENT
    if len(numbers) == 4:
        box = tuple(numbers)
    elif len(numbers) >= 6 and len(numbers) % 2 == 0:
        box = _enclosing(np.array(numbers).reshape(-1, 2))
    else:
        raise SequenceError(f'{where}: {len(numbers)} numbers; expected 4 (x, y, width, height) '
                            'or the corners of a polygon')
    return box if box[2] > 0 and box[3] > 0 else _ABSENT


def _enclosing(corners: npt.NDArray[np.float64]) -> tuple[float, ...]:
    low, high = corners.min(axis=0), corners.max(axis=0)
    return (*low.tolist(), *(high - low).tolist())
