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

"""Ground truth as text: one row of numbers a frame, or rows that name their frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math
from pathlib import Path
import re

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.number_rows import (
    find_rows, NumberRow, read_rows, Rows, Split, split_at_commas, split_beside_commas)
from lmsco_ros.evaluation.datasets.row_forms import (
    Columns, enclosing, is_outline, MOT_COLUMNS, named_columns, numbered_by_frame)
from lmsco_ros.evaluation.datasets.text_file import read_lines
from lmsco_ros.evaluation.errors import SequenceError

Boxes = npt.NDArray[np.float64]

_ACCEPTED = ('accepted are x,y,width,height, the corners of a polygon, rows of MOT of one target, '
             'and nan or a blank row for an absent target (docs/datasets.md)')
_ABSENT = (math.nan,) * 4
# What some programs write in place of a box that is not there.
_NO_BOX = (-1.0,) * 4
# Nine hours at thirty frames a second.
_MOST_FRAMES = 1_000_000
_LONGEST_FRACTION = 4
_DECIMAL_COMMA = re.compile(r'[+-]?\d+,\d+', re.ASCII)


def read_boxes(path: Path, frames: int | None = None) -> Boxes:
    """
    Return the boxes of a ground-truth file.

    Parameters
    ----------
    path : Path
        Rows of four numbers (x, y, width, height), of polygon corners (x1, y1, x2, y2, ...),
        or of MOT (frame, id, x, y, width, height, conf, ...) with a single id, separated by
        commas, semicolons or white space. All accepted forms are in `docs/datasets.md`.
    frames : int, optional
        Number of frames of the sequence. Rows of MOT are continued to it as absent; other
        rows stand for one frame each, however many there are.

    Returns
    -------
    ndarray, shape (n, 4), float64
        Coordinates as they are written. A polygon becomes its enclosing upright box, as the
        VOT toolkit does for trackers that report boxes. Blank rows, rows with `nan`, rows that
        are `0`, `1` or `2` alone, four times -1, and boxes without area become NaN: absent.

    Raises
    ------
    SequenceError
        When the file is empty, or a row is not understood or could be two things.

    """
    try:
        rows = find_rows(read_lines(path))
        if not rows.rows:
            raise SequenceError('holds no row of numbers')
        return _boxes(rows, frames)
    except SequenceError as error:
        raise SequenceError(f'{path.name}: {error}; {_ACCEPTED}') from error


def _boxes(rows: Rows, frames: int | None) -> Boxes:
    """Return what the rows say with the one meaning that commas can have in all of them."""
    with_commas_between = _attempt(rows, split_at_commas, frames)
    if not _may_have_decimal_commas(rows):
        return _sure(with_commas_between)
    with_decimal_commas = _attempt(rows, split_beside_commas, frames)
    if isinstance(with_decimal_commas, SequenceError):
        return _sure(with_commas_between)
    if isinstance(with_commas_between, SequenceError) or _has_decimal_commas(rows):
        return with_decimal_commas
    first = next(row for row in rows.rows if row.text)
    raise first.refused('its commas could be decimal ones or part x and y of corners; write '
                        'decimal points, or a comma between all numbers')


def _attempt(rows: Rows, split: Split, frames: int | None) -> Boxes | SequenceError:
    try:
        numbers = read_rows(rows.rows, split)
        columns = named_columns(rows.header) if rows.header else None
        if columns is None and numbered_by_frame([row for row in numbers if row.numbers]):
            columns = MOT_COLUMNS
        if columns is not None and columns.frame is not None:
            return _by_frame(numbers, columns, frames, len(rows.header))
        return np.array([_box(row, columns, len(rows.header)) for row in numbers], dtype=float)
    except SequenceError as error:
        return error


def _sure(outcome: Boxes | SequenceError) -> Boxes:
    if isinstance(outcome, SequenceError):
        raise outcome
    return outcome


def _may_have_decimal_commas(rows: Rows) -> bool:
    """Return whether something else than commas parts numbers, and no point is a decimal one."""
    return not any('.' in row.text for row in rows.rows) and any(
        _DECIMAL_COMMA.fullmatch(word) for row in rows.rows
        for word in split_beside_commas(row.text))


def _has_decimal_commas(rows: Rows) -> bool:
    """
    Return whether rows that could be pairs `x,y` of corners cannot be that after all.

    As corners every word is a pair, no y begins with a zero or has many digits, and all rows
    are outlines that do not cross themselves.
    """
    for row in rows.rows:
        words = split_beside_commas(row.text)
        if len(words) < 4 or 'nan' in row.text.lower():
            continue
        if not all(map(_DECIMAL_COMMA.fullmatch, words)):
            return True
        fractions = [word.split(',')[1] for word in words]
        if any(len(digits) > _LONGEST_FRACTION or (digits[0] == '0' and len(digits) > 1)
               for digits in fractions):
            return True
        if not is_outline([float(part) for word in words for part in word.split(',')]):
            return True
    return False


def _by_frame(rows: Sequence[NumberRow], columns: Columns, frames: int | None,
              width: int) -> Boxes:
    """Return boxes in the order of their frames; frames without a row are absent."""
    numbered = [row for row in rows if row.text]
    width = width or len(numbered[0].numbers)
    _refuse_several_targets(numbered, columns)
    places = dict(_places(numbered, columns))
    # Frames count from 1, as in MOT, unless there is a frame 0.
    first = 0 if 0 in places else 1
    last = max(places) - first
    if frames is not None and last >= frames:
        raise places[max(places)].refused(f'there are {frames} frames only')
    boxes = np.full((max(last + 1, frames or 0), 4), math.nan)
    for place, row in places.items():
        boxes[place - first] = _box(row, columns, width)
    return boxes


def _places(rows: Sequence[NumberRow], columns: Columns) -> Iterator[tuple[int, NumberRow]]:
    seen: set[float] = set()
    for row in rows:
        number = next(iter(row.numbers[columns.frame:]), math.nan)
        if not (number.is_integer() and 0 <= number <= _MOST_FRAMES):
            raise row.refused(f'a number of a frame is a whole one from 0 to {_MOST_FRAMES:,}')
        if number in seen:
            raise row.refused(f'frame {number:.0f} has a row already')
        seen.add(number)
        yield int(number), row


def _refuse_several_targets(rows: Sequence[NumberRow], columns: Columns) -> None:
    if columns.identity is None:
        return
    found = {row.numbers[columns.identity]: row for row in reversed(rows)
             if len(row.numbers) > columns.identity}
    if len(found) > 1:
        names = sorted(found)
        shown = ', '.join(f'{name:g}' for name in names[:8]) + ', ...' * (len(names) > 8)
        other = max(found.values(), key=lambda row: row.line)
        raise other.refused(f'rows of {len(names)} targets (ids {shown}); keep those of one')


def _box(row: NumberRow, columns: Columns | None, width: int) -> tuple[float, ...]:
    """Return the box of a row, NaN for an absent target."""
    count = len(row.numbers)
    if not count:
        return _ABSENT
    if width and count != width:
        raise row.refused(f'{count} numbers where {width} are expected')
    if columns is None:
        values, corners = row.numbers, count != 4
        if corners and (count < 6 or count % 2):
            raise row.refused(f'{count} numbers')
    else:
        corners = bool(columns.corners)
        values = tuple(row.numbers[index] for index in columns.corners or columns.box)
        if columns.confidence is not None and row.numbers[columns.confidence] == 0:
            return _ABSENT
    if any(map(math.isnan, values)) or values == _NO_BOX:
        return _ABSENT
    box = enclosing(values) if corners else values
    if box[2] < 0 or box[3] < 0:
        raise row.refused('a width or height below zero')
    return box if box[2] > 0 and box[3] > 0 else _ABSENT
