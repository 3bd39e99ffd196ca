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

"""Values as they come out of JSON, checked before anything is made of them."""

from __future__ import annotations

from collections.abc import Iterable
import json
import math
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.errors import ResultError

# What goes wrong when content is not of the form that is expected.
MISFITS = (AttributeError, IndexError, KeyError, OverflowError, RecursionError, TypeError,
           ValueError)


def read_object(path: Path) -> dict[str, Any]:
    """
    Return the object in a JSON file.

    Raises
    ------
    ResultError
        When the file is empty, cut off, no JSON, or holds something else.

    """
    try:
        return the_object(json.loads(path.read_bytes(), parse_constant=_refuse_constant))
    except MISFITS as error:
        raise ResultError(damaged(path, error)) from error


def damaged(path: Path, error: Exception) -> str:
    """Return the words for a damaged file."""
    reason = f'{error} is missing' if isinstance(error, KeyError) else str(error)
    return f'{path} is damaged ({reason})'


def the_object(value: Any) -> dict[str, Any]:
    """Return `value` if it is an object, or raise `TypeError`."""
    return _of_type(value, dict, 'an object')


def the_list(value: Any) -> list[Any]:
    """Return `value` if it is a list, or raise `TypeError`."""
    return _of_type(value, list, 'a list')


def the_text(value: Any) -> str:
    """Return `value` if it is text, or raise `TypeError`."""
    return _of_type(value, str, 'text')


def whole_number(value: Any, below: float = math.inf) -> int:
    """Return `value` if it is a whole number in [0, below), or raise an error."""
    number = _of_type(value, int, 'a whole number')
    if not 0 <= number < below:
        raise ValueError(f'{number} is not from 0 on and below {below}')
    return number


def whole_numbers(value: Any, below: float = math.inf) -> list[int]:
    """Return a list of whole numbers in [0, below), or raise an error."""
    return [whole_number(item, below) for item in the_list(value)]


def numbers(values: Iterable[Any]) -> npt.NDArray[np.float64]:
    """Return numbers, shape (n,), NaN for None, or raise an error where there is another value."""
    return np.array([math.nan if value is None else number(value) for value in values])


def number(value: Any) -> float:
    """Return `value` if it is a number, or raise an error."""
    if type(value) not in (int, float):
        raise TypeError(f'{str(value)[:40]!r} where a number is expected')
    if not math.isfinite(value):
        raise ValueError(f'{value} where a finite number is expected')
    return float(value)


def box_rows(value: Any) -> npt.NDArray[np.float64]:
    """Return boxes, shape (n, 4), from rows of four, None for NaN and for a row of them."""
    rows = [[None] * 4 if row is None else the_list(row) for row in the_list(value)]
    if any(len(row) != 4 for row in rows):
        raise ValueError('a box has four numbers')
    return numbers(item for row in rows for item in row).reshape(-1, 4)


def _of_type(value: Any, kind: type, words: str) -> Any:
    if type(value) is not kind:
        raise TypeError(f'{str(value)[:40]!r} where {words} is expected')
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f'{name} is no number of JSON')
