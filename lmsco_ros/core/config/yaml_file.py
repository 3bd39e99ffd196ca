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

"""Plain values from YAML files that anybody may have written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from yaml.reader import ReaderError

from lmsco_ros.core.errors import ConfigError

__all__ = ['read_mapping']

# A configuration with every key written out has 4 kB, 200 values and a depth of 4.
_MOST_BYTES = 100_000
_MOST_VALUES = 10_000
_DEEPEST = 20


def read_mapping(path: str | Path) -> dict[str, Any]:
    """
    Return the keys and values in a YAML file; an empty file has none.

    What a file may cost is bounded before it is spent: aliases count as what they stand for.

    Parameters
    ----------
    path : str or Path
        The file, in UTF-8 or UTF-16.

    Raises
    ------
    ConfigError
        When the file cannot be read, is not YAML, holds something else than keys and values, a
        key twice, or more than a configuration can need. Names the file in one line.

    """
    try:
        return _parsed(_read(path))
    except (OSError, ValueError) as error:
        # Names of files that no file can have are ValueErrors.
        reason = getattr(error, 'strerror', None) or ' '.join(str(error).split())
        raise ConfigError(f'cannot read the configuration {path}: {reason}; expected a YAML file '
                          'with keys and values') from error


def _read(path: str | Path) -> bytes:
    with open(path, 'rb') as stream:
        text = stream.read(_MOST_BYTES + 1)
    if len(text) > _MOST_BYTES:
        raise ConfigError(f'it has more than {_MOST_BYTES} bytes')
    return text


def _parsed(text: bytes) -> dict[str, Any]:
    """Return the values; numbers and dates that are none of what they look are ValueErrors."""
    try:
        _check(yaml.compose(text, yaml.SafeLoader))
        data = yaml.safe_load(text)
    except RecursionError as error:
        raise ConfigError('it is nested too deeply') from error
    except yaml.MarkedYAMLError as error:
        raise ConfigError(_place(error) + (error.problem or 'it is malformed')) from error
    except ReaderError as error:
        raise ConfigError(f'it is not text in UTF-8 (character {error.position}: '
                          f'{error.reason})') from error
    if data is None:
        return {}
    if not isinstance(data, Mapping):
        raise ConfigError(f'it holds a {type(data).__name__}')
    return dict(data)


def _place(error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    return f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''


def _check(root: yaml.Node | None) -> None:
    """Raise ConfigError when the values below a node are too many, or a key is there twice."""
    pending = [] if root is None else [(root, 1)]
    count = 0
    while pending:
        node, depth = pending.pop()
        count += 1
        if depth > _DEEPEST:
            raise ConfigError(f'it is nested more than {_DEEPEST} levels deep')
        if count > _MOST_VALUES:
            raise ConfigError(f'it has more than {_MOST_VALUES} values')
        if isinstance(node, yaml.MappingNode):
            _check_keys(node)
            pending += [(child, depth + 1) for pair in node.value for child in pair]
        elif isinstance(node, yaml.SequenceNode):
            pending += [(child, depth + 1) for child in node.value]


def _check_keys(node: yaml.MappingNode) -> None:
    seen = set()
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode):
            if key.value in seen:
                raise ConfigError(f'line {key.start_mark.line + 1}: the key '
                                  f'{key.value[:80]!r} is there twice')
            seen.add(key.value)
