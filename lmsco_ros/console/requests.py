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

"""What a browser may ask for: JSON in, plain values out; nothing else passes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import json
import math
from typing import Any

from lmsco_ros.console.picture import Look, PALETTES

MOST_BYTES = 2048
_LARGEST = 1e6
_MOST_STEPS = 100


class RequestError(ValueError):
    """A message from the browser cannot be used; says what was expected."""


@dataclass(frozen=True)
class Next:
    """Send the next frame; the one with the number `drawn` is on the screen."""

    drawn: int


@dataclass(frozen=True)
class Step:
    """Send the frame `by` steps from that of a number."""

    number: int
    by: int


@dataclass(frozen=True)
class Start:
    """Follow what is in a box (x, y, width, height) of the frame with a stamp."""

    stamp: int
    box: tuple[float, float, float, float]


@dataclass(frozen=True)
class Point:
    """Follow what is at a pixel of the frame with a stamp."""

    stamp: int
    x: float
    y: float


@dataclass(frozen=True)
class Select:
    """Select a target."""

    track_id: int


@dataclass(frozen=True)
class Reset:
    """Drop all targets."""


@dataclass(frozen=True)
class Enable:
    """Let the tracker go on, or pause."""

    on: bool


@dataclass(frozen=True)
class Absent:
    """Mark the frame with a stamp of a recording as one without the target."""

    stamp: int


@dataclass(frozen=True)
class Unmark:
    """Take the mark of the frame with a stamp of a recording away."""

    stamp: int


@dataclass(frozen=True)
class Record:
    """Begin or end a recording."""

    on: bool


Command = Start | Point | Select | Reset | Enable | Record | Absent | Unmark
Request = Command | Next | Step | Look


def parse_request(text: str) -> Request:
    """
    Return what a message asks for.

    Parameters
    ----------
    text : str
        A JSON object with a `type` and the fields of one of the requests; times in
        nanoseconds are text, as JavaScript has no such numbers.

    Raises
    ------
    RequestError
        When it is anything else.

    """
    if len(text.encode(errors='replace')) > MOST_BYTES:
        raise RequestError(f'a message is longer than {MOST_BYTES} bytes')
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        raise RequestError('a message is no JSON') from None
    kind = fields.get('type') if isinstance(fields, dict) else None
    reader = _READERS.get(kind) if isinstance(kind, str) else None
    if reader is None:
        raise RequestError(f'a message has no known type; expected one of {", ".join(_READERS)}')
    return reader(fields)


def _whole(fields: Mapping[str, Any], name: str, low: int, high: int) -> int:
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RequestError(f'{name} is wrong; expected a whole number from {low} to {high}')
    return value


def _pixels(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) \
            or not abs(value) <= _LARGEST or not math.isfinite(value):
        raise RequestError(f'{name} is wrong; expected a number of pixels')
    return float(value)


def _flag(fields: Mapping[str, Any], name: str) -> bool:
    value = fields.get(name)
    if not isinstance(value, bool):
        raise RequestError(f'{name} is wrong; expected true or false')
    return value


def _stamp(fields: Mapping[str, Any]) -> int:
    value = fields.get('stamp')
    # Seconds of a stamp are signed 32 bits.
    if not isinstance(value, str) or not value.isascii() or not value.isdigit() \
            or len(value) > 19 or int(value) >= 2 ** 31 * 10 ** 9:
        raise RequestError('stamp is wrong; expected the nanoseconds of a frame as text')
    return int(value)


def _start(fields: Mapping[str, Any]) -> Start:
    numbers = fields.get('box')
    if not isinstance(numbers, list) or len(numbers) != 4:
        raise RequestError('box is wrong; expected x, y, width, height in pixels')
    x, y, width, height = (_pixels(number, 'box') for number in numbers)
    if width <= 0 or height <= 0:
        raise RequestError('box is empty; expected a positive width and height')
    return Start(_stamp(fields), (x, y, width, height))


def _point(fields: Mapping[str, Any]) -> Point:
    return Point(_stamp(fields), _pixels(fields.get('x'), 'x'), _pixels(fields.get('y'), 'y'))


def _look(fields: Mapping[str, Any]) -> Look:
    palette = fields.get('palette')
    if not isinstance(palette, str) or palette not in PALETTES:
        raise RequestError(f'palette is wrong; expected one of {", ".join(PALETTES)}')
    return Look(palette, _flag(fields, 'confidence'))


_NUMBERS = 2 ** 53
_READERS: dict[str, Callable[[Mapping[str, Any]], Request]] = {
    'next': lambda fields: Next(_whole(fields, 'drawn', 0, _NUMBERS)),
    'step': lambda fields: Step(_whole(fields, 'number', 0, _NUMBERS),
                                _whole(fields, 'by', -_MOST_STEPS, _MOST_STEPS)),
    'look': _look,
    'start': _start,
    'point': _point,
    'select': lambda fields: Select(_whole(fields, 'id', 0, 2 ** 32 - 1)),
    'reset': lambda fields: Reset(),
    'record': lambda fields: Record(_flag(fields, 'on')),
    'absent': lambda fields: Absent(_stamp(fields)),
    'unmark': lambda fields: Unmark(_stamp(fields)),
    'enable': lambda fields: Enable(_flag(fields, 'on')),
}
