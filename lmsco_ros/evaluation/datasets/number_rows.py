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

"""Rows of numbers in a text: what is a row, and what parts its numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import re

from lmsco_ros.evaluation.errors import SequenceError

_COMMENT = re.compile(r'\s*(#|%|//)\W*')
_SEPARATOR = re.compile(r'\s*[,;]\s*|\s+')
_SEPARATOR_BESIDE_DECIMAL_COMMAS = re.compile(r'\s*;\s*|\s+')
_NUMBER = re.compile(r'[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?', re.IGNORECASE | re.ASCII)
_NUMBER_WITH_COMMA = re.compile(r'[+-]?\d+(,\d+)?(e[+-]?\d+)?', re.IGNORECASE | re.ASCII)
_NAN = re.compile(r'[+-]?nan(\(\w*\))?', re.IGNORECASE)
# What the VOT toolkit writes in place of a box: nothing known, start, failure.
_SPECIAL = frozenset({'0', '1', '2'})
_MOST_SHOWN = 60
_LARGEST = 1e7

Split = Callable[[str], list[str]]


@dataclass(frozen=True)
class TextRow:
    """
    One row of a text.

    Attributes
    ----------
    line : int
        Its line in the file, from 1 on.
    text : str
        What stands there; empty for a blank row.

    """

    line: int
    text: str

    def refused(self, reason: str) -> SequenceError:
        """Return the error that names this row; `reason` goes on after what it holds."""
        shown = self.text if len(self.text) <= _MOST_SHOWN else f'{self.text[:_MOST_SHOWN]}...'
        return SequenceError(f'line {self.line}, {shown!r}: {reason}')


@dataclass(frozen=True)
class NumberRow(TextRow):
    """
    One row of numbers.

    Attributes
    ----------
    numbers : tuple of float
        Finite, or NaN; empty where the row says that there is no target.

    """

    numbers: tuple[float, ...] = ()


@dataclass(frozen=True)
class Rows:
    """
    The rows of a text, its comments and the blank lines at its end left out.

    Attributes
    ----------
    header : tuple of str
        Names of the columns in lower case; empty without such a row.
    rows : tuple of TextRow
        From the first on; blank lines between them count.

    """

    header: tuple[str, ...]
    rows: tuple[TextRow, ...]


def find_rows(lines: list[str]) -> Rows:
    """
    Return what is a row of a text and what is its header.

    Raises
    ------
    SequenceError
        When nobody knows whether a line stands for a frame: a blank one below a header or
        comment, and a row of numbers between others that is made a comment.

    """
    every = [TextRow(number, line.strip()) for number, line in enumerate(lines, start=1)]
    comments = [row for row in every if _COMMENT.match(row.text)]
    rows = [row for row in every if not _COMMENT.match(row.text)]
    while rows and not rows[-1].text:
        rows.pop()
    first = next((index for index, row in enumerate(rows) if row.text), 0)
    header = _names(rows[first].text) if rows else ()
    if header:
        rows = rows[first + 1:]
    begin = next((row.line for row in rows if row.text), 0)
    if rows and not rows[0].text and (header or any(row.line < begin for row in comments)):
        raise rows[0].refused('a blank line in the head of the file, which may be an absent '
                              'target or an ornament; delete it or write nan')
    for row in comments:
        if rows and rows[0].line < row.line < rows[-1].line and _holds_numbers(row.text):
            raise row.refused('a row of numbers as a comment between others; delete it where its '
                              'frame is deleted too, or write nan where the target is absent')
    return Rows(header, tuple(rows))


def split_at_commas(text: str) -> list[str]:
    """Return what stands between commas, semicolons and white space."""
    return _SEPARATOR.split(_without_end(text))


def split_beside_commas(text: str) -> list[str]:
    """Return what stands between semicolons and white space; commas are part of numbers."""
    return _SEPARATOR_BESIDE_DECIMAL_COMMAS.split(_without_end(text))


def read_rows(rows: tuple[TextRow, ...], split: Split) -> tuple[NumberRow, ...]:
    """
    Return the numbers of rows.

    Parameters
    ----------
    rows : tuple of TextRow
        Rows as they stand in the file.
    split : callable
        `split_at_commas` or `split_beside_commas`, after which the comma is a decimal one.

    Raises
    ------
    SequenceError
        When a row is none of numbers; it names the row.

    """
    return tuple(NumberRow(row.line, row.text, _numbers(row, split)) for row in rows)


def _numbers(row: TextRow, split: Split) -> tuple[float, ...]:
    words = split(row.text)
    absent = not any(words) or all(map(_NAN.fullmatch, words)) or (
        len(words) == 1 and words[0] in _SPECIAL)
    if absent:
        return ()
    if not all(words):
        raise row.refused('a number is missing between two separators')
    pattern = _NUMBER if split is split_at_commas else _NUMBER_WITH_COMMA
    for word in words:
        if not (pattern.fullmatch(word) or _NAN.fullmatch(word)):
            raise row.refused(f'{word[:_MOST_SHOWN]!r} is no number')
    numbers = tuple(float('nan') if _NAN.fullmatch(word) else float(word.replace(',', '.'))
                    for word in words)
    if any(abs(number) > _LARGEST for number in numbers):
        raise row.refused(f'no image has more than {_LARGEST:.0e} pixels in a row')
    return numbers


def _names(text: str) -> tuple[str, ...]:
    """Return the names of columns that a row consists of; nothing where it holds a number."""
    words = [word.strip('"\'').lower() for word in split_at_commas(text)]
    return () if any(_is_number(word) or not word for word in words) else tuple(words)


def _holds_numbers(comment: str) -> bool:
    words = split_at_commas(_COMMENT.sub('', comment, count=1))
    return len(words) > 1 and all(map(_is_number, words))


def _is_number(word: str) -> bool:
    return bool(_NUMBER.fullmatch(word) or _NAN.fullmatch(word))


def _without_end(text: str) -> str:
    """Return a row without one separator at its end, as some programs write it."""
    words = ' '.join(text.split())
    return re.sub(r' ?[,;]$', '', words) if words.strip(' ,;') else ''
