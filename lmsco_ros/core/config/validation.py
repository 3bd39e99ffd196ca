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

"""Checks and plain-data conversion of the frozen configuration dataclasses."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
import dataclasses
import difflib
import math
import reprlib
import types
import typing
from typing import Any

from lmsco_ros.core.errors import ConfigError

__all__ = ['build', 'check_choice', 'check_range', 'shown']

# What a message shows of a text, and the length from which a number is not shown at all.
_LONGEST = 80
_DIGITS = 40


def check_range(owner: object, name: str, low: float, high: float, *,
                open_low: bool = False) -> None:
    """
    Raise ConfigError unless `low` <= owner.name <= `high` (`low` < with `open_low`).

    Parameters
    ----------
    owner : object
        Configuration section.
    name : str
        Its field.
    low, high : float
        Allowed range.
    open_low : bool
        Whether `low` itself is refused.

    """
    value = getattr(owner, name)
    # Whole numbers may be too large for what asks whether they are finite.
    if not -math.inf < value < math.inf or not low <= value <= high or (
            open_low and value == low):
        bracket = '(' if open_low else '['
        raise ConfigError(f'{type(owner).__name__}.{name} is {shown(value)}; '
                          f'expected a value in {bracket}{low}, {high}]')


def check_choice(owner: object, name: str, choices: tuple[str, ...]) -> None:
    """Raise ConfigError unless owner.name is one of `choices`."""
    value = getattr(owner, name)
    if value not in choices:
        raise ConfigError(f'{type(owner).__name__}.{name} is {shown(value)}; '
                          f'expected one of {", ".join(choices)}')


def build(kind: type, data: Any, where: str = '') -> Any:
    """
    Build a configuration dataclass from nested mappings and lists.

    Parameters
    ----------
    kind : type
        Dataclass; fields may be numbers, strings, dataclasses, or tuples of these.
    data : mapping
        Values by field name; what is left out keeps its default.
    where : str
        Path of `data` in the file, for messages.

    Raises
    ------
    ConfigError
        On an unknown key (names the nearest known one), a missing one without a default, or a
        value of the wrong type.

    """
    if not isinstance(data, Mapping):
        raise ConfigError(f'{where or "the configuration"} is {shown(data)}; expected keys and '
                          f'values: {", ".join(f.name for f in dataclasses.fields(kind))}')
    hints = typing.get_type_hints(kind)
    known = [field.name for field in dataclasses.fields(kind)]
    for key in data:
        if key not in known:
            name = key[:_LONGEST] if isinstance(key, str) else shown(key)
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
            raise ConfigError(f'unknown key {_join(where, name)!r}; did you mean '
                              f'{near[0]!r}? Known keys: {", ".join(known)}')
    for field in dataclasses.fields(kind):
        if field.default is dataclasses.MISSING and field.name not in data:
            raise ConfigError(f'{where or "the configuration"} is {shown(data)}, without '
                              f'{field.name!r}, which has no default; give it')
    return kind(**{key: _convert(hints[key], value, _join(where, key))
                   for key, value in data.items()})


def _join(where: str, key: str) -> str:
    """Return the path of a key."""
    return f'{where}.{key}' if where else key


def _convert(hint: Any, value: Any, where: str) -> Any:
    """Return `value` as the type that the field declares."""
    if dataclasses.is_dataclass(hint):
        return build(typing.cast(type, hint), value, where)
    if typing.get_origin(hint) is tuple:
        if isinstance(value, str) or not isinstance(value, (list, tuple)):
            raise ConfigError(f'{where} is {shown(value)}; expected a list')
        item = typing.get_args(hint)[0]
        return tuple(_convert(item, v, f'{where}[{i}]') for i, v in enumerate(value))
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        if value is None:
            return None
        hint = typing.get_args(hint)[0]
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if hint is float and number:
        # Whole numbers may be larger than any float.
        with suppress(OverflowError):
            return float(value)
    if hint is int and number and (isinstance(value, int) or value.is_integer()):
        return int(value)
    if hint in (bool, str) and isinstance(value, hint):
        return value
    raise ConfigError(f'{where} is {shown(value)}; expected a {hint.__name__}')


def shown(value: object) -> str:
    """Return what a message shows of a value of any size, which may hold itself."""
    if isinstance(value, int) and abs(value) >= 10 ** (_DIGITS - 1):
        return f'a number with {_DIGITS} digits or more'
    brief = reprlib.Repr()
    brief.maxstring = brief.maxother = _LONGEST
    brief.maxlevel = 3
    return brief.repr(value)
