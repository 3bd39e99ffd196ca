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
What the numbers of a row mean, told by the header or by all rows together.

A row of eight numbers is a polygon of four corners or a row of MOT: frame, identity, x, y,
width, height, confidence, class. One row cannot tell; a whole file mostly can: frames count
up, identities repeat and confidences lie between -1 and 1, while annotated boxes are
parallelograms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from lmsco_ros.evaluation.datasets.number_rows import NumberRow
from lmsco_ros.evaluation.errors import SequenceError

# The names under which a column is known, by what it is called here.
_COLUMNS = {
    'x1': ('x', 'left', 'bb_left', 'xmin', 'x_min', 'x1'),
    'y1': ('y', 'top', 'bb_top', 'ymin', 'y_min', 'y1'),
    'width': ('w', 'width', 'bb_width'), 'height': ('h', 'height', 'bb_height'),
    'x2': ('xmax', 'x_max', 'right', 'x2'), 'y2': ('ymax', 'y_max', 'bottom', 'y2'),
    'frame': ('frame', 'frame_id', 'frame_number'), 'identity': ('id', 'track_id', 'object_id'),
    'confidence': ('conf', 'confidence')}
_NAMES = {name: column for column, names in _COLUMNS.items() for name in names}
_BOX = ('x1', 'y1', 'width', 'height')
_MOT_COLUMNS = 10
# Corners are written with two decimals or more.
_CORNER_TOLERANCE = 0.05


@dataclass(frozen=True)
class Columns:
    """
    Which column holds what; None for what there is no column of.

    Attributes
    ----------
    corners : tuple of int
        Columns of x and y of each corner; empty where there is a size.
    box : tuple of int
        Columns of x, y, width and height; empty where there are corners.
    frame, identity, confidence : int or None
        Number of the frame; number of the target; 0 where a box is not to be counted.

    """

    corners: tuple[int, ...] = ()
    box: tuple[int, ...] = ()
    frame: int | None = None
    identity: int | None = None
    confidence: int | None = None


MOT_COLUMNS = Columns(box=(2, 3, 4, 5), frame=0, identity=1, confidence=6)


def named_columns(header: Sequence[str]) -> Columns:
    """
    Return the columns of a header.

    Raises
    ------
    SequenceError
        When it names no box, or anything that is not known here.

    """
    places: dict[str, int] = {}
    for index, name in enumerate(header):
        places.setdefault(_NAMES.get(name, name), index)
    beside = [places.pop(name, None) for name in ('frame', 'identity', 'confidence')]
    corners = tuple(f'{axis}{number + 1}' for number in range(len(places) // 2) for axis in 'xy')
    order = _BOX if set(places) == set(_BOX) else corners
    if len(order) < 4 or set(places) != set(order) or len(set(header)) < len(header):
        raise SequenceError(
            f'the header {",".join(header)!r} is not understood; columns may be x,y,width,height '
            'or xmin,ymin,xmax,ymax or x1,y1,...,x4,y4, beside frame, id and conf')
    found = tuple(places[name] for name in order)
    return Columns(*(((), found) if order is _BOX else (found, ())), *beside)


def numbered_by_frame(rows: Sequence[NumberRow]) -> bool:
    """
    Return whether rows without a header are rows of MOT, which begin with frame and identity.

    Parameters
    ----------
    rows : sequence of NumberRow
        Rows that hold numbers.

    Raises
    ------
    SequenceError
        When they could be rows of MOT as well as polygons.

    """
    known = [row for row in rows if len(row.numbers) >= 6
             and not any(map(math.isnan, row.numbers))]
    if not known or not all(_may_be_mot(row) for row in known):
        return False
    if all(row.numbers[7:] == (-1, -1, -1) for row in known):
        return True
    counting, confident = _frames_count_up(known), _confidences(known)
    likely = counting and confident
    if all(map(_is_parallelogram, known)):
        in_doubt = likely
    elif likely:
        return True
    else:
        in_doubt = counting or confident
    if in_doubt:
        raise known[0].refused('could be corners of a polygon or frame,id,x,y,width,height,...; '
                               'say which by a header, such as frame,id,x,y,width,height')
    return False


def enclosing(corners: Sequence[float]) -> tuple[float, ...]:
    """Return the upright box around corners (x1, y1, x2, y2, ...) as x, y, width, height."""
    points = np.reshape(corners, (-1, 2))
    low, high = points.min(axis=0), points.max(axis=0)
    return (*low.tolist(), *(high - low).tolist())


def is_outline(corners: Sequence[float]) -> bool:
    """Return whether corners (x1, y1, ...), in their order, enclose an area without crossing."""
    points = np.reshape(corners, (-1, 2))
    edges = [(points[index - 1], points[index]) for index in range(len(points))]
    return not any(_cross(*edges[one], *edges[other]) for one in range(len(edges))
                   for other in range(one) if 1 < one - other < len(edges) - 1
                   ) and _area(points) > 0


def _frames_count_up(rows: Sequence[NumberRow]) -> bool:
    """Return whether the first column counts up for each of few values of the second."""
    last: dict[float, float] = {}
    for row in rows:
        frame, identity = row.numbers[:2]
        if frame <= last.get(identity, -1):
            return False
        last[identity] = frame
    few = len(last) <= max(1, len(rows) // 2)
    return few and (len(rows) > 1 or rows[0].numbers[0] <= 1)


def _confidences(rows: Sequence[NumberRow]) -> bool:
    return all(len(row.numbers) > 6 and abs(row.numbers[6]) <= 1 for row in rows)


def _may_be_mot(row: NumberRow) -> bool:
    return len(row.numbers) <= _MOT_COLUMNS and all(
        number.is_integer() and number >= -1 for number in row.numbers[:2])


def _is_parallelogram(row: NumberRow) -> bool:
    if len(row.numbers) != 8:
        return False
    first, second, third, fourth = np.reshape(row.numbers, (-1, 2))
    return bool(np.abs(first + third - second - fourth).max() <= _CORNER_TOLERANCE)


def _area(points: np.ndarray) -> float:
    following = np.roll(points, -1, axis=0)
    return abs(float(_product(points, following).sum())) / 2


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> bool:
    """Return whether the lines from a to b and from c to d meet."""
    return bool(_product(b - a, c - a) * _product(b - a, d - a) <= 0
                and _product(d - c, a - c) * _product(d - c, b - c) <= 0)


def _product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
