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

"""Ground truth as JSON: the labels of Anti-UAV."""

from __future__ import annotations

from collections.abc import Sequence
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.text_file import read_text
from lmsco_ros.evaluation.errors import SequenceError

_ABSENT = (math.nan,) * 4
# No image has as many pixels in a row.
_LARGEST = 1e7


def read_json_boxes(labels: Path) -> npt.NDArray[np.float64]:
    """
    Return the boxes of a file with the lists `exist` and `gt_rect`.

    Parameters
    ----------
    labels : Path
        JSON object; `exist` holds 0 or 1 a frame, `gt_rect` x, y, width and height, or nothing
        where the target is absent.

    Returns
    -------
    ndarray, shape (n, 4), float64
        Boxes; NaN where the target is absent or the box has no area.

    Raises
    ------
    SequenceError
        When the file is no such object, the lists differ in length, or an entry is no box.

    """
    try:
        content = json.loads(read_text(labels))
        exist, rectangles = content['exist'], content['gt_rect']
        if not isinstance(exist, list) or not isinstance(rectangles, list):
            raise TypeError('they are no lists')
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise SequenceError(f'{labels.name}: expected an object with the lists `exist` and '
                            f'`gt_rect`, one entry a frame ({error})') from error
    if len(exist) != len(rectangles):
        raise SequenceError(f'{labels.name}: {len(exist)} entries in `exist` but '
                            f'{len(rectangles)} in `gt_rect`; both need one a frame')
    boxes = [_box(present, rectangle, f'{labels.name}: entry {index}')
             for index, (present, rectangle) in enumerate(zip(exist, rectangles))]
    return np.array(boxes, dtype=float).reshape(-1, 4)


def _box(present: Any, rectangle: Any, where: str) -> Sequence[float]:
    if present not in (0, 1):
        raise SequenceError(f'{where} of `exist` is {str(present)[:40]!r}; expected 0 or 1')
    if not present or rectangle in ([], None):
        return _ABSENT
    if not isinstance(rectangle, list) or len(rectangle) != 4 or not all(map(_finite, rectangle)):
        raise SequenceError(f'{where} of `gt_rect` is {str(rectangle)[:60]!r}; expected '
                            '[x, y, width, height], or [] where the target is absent')
    return rectangle if min(rectangle[2:]) > 0 else _ABSENT


def _finite(number: Any) -> bool:
    return type(number) in (int, float) and abs(number) < _LARGEST
