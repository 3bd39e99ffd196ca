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
Write `docs/public_api.md`: every name on whose meaning others may rely.

A name that is gone from the page without a deprecation breaks somebody's program, and a new one
is a promise; both are seen in the difference of the page. What is promised: `RELEASING.md`.
"""

from __future__ import annotations

import ast
from collections import ChainMap
from collections.abc import Iterator
import dataclasses
import inspect
from pathlib import Path
from typing import Any

import click
import typer
import yaml

from lmsco_ros import core
from lmsco_ros.cli.main import build_app
from lmsco_ros.core.config import ChannelConfig, FeatureConfig
from lmsco_ros.evaluation.run_file import SequenceInfo
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.replay.results_file import COLUMNS

REPOSITORY = Path(__file__).resolve().parents[1]
PAGE = REPOSITORY / 'docs' / 'public_api.md'
HEAD = """\
# Public names

Written by `scripts/public_api.py` from the code; do not change by hand. On these names others may
rely: none goes without a deprecation before, and none changes its meaning within a first number of
the version (`RELEASING.md` has the rules). `=` marks parameters that may be left out; further ones
may be added. What the names mean: [API](api.md), [configuration](configuration.md), `lmsco COMMAND
--help`, and the tables of the README.
"""
# How the adapters read files of images is their own affair.
INNER_ADAPTERS = {'compressed_depth', 'encodings', 'image_file', 'jpeg_file', 'png_file'}


def python_names() -> Iterator[str]:
    """Yield what `lmsco_ros.core` exports, with what is public of each."""
    for name in sorted(core.__all__):
        exported = getattr(core, name)
        if issubclass(exported, Exception):
            yield f'{name}({exported.__base__.__name__})'
            continue
        yield name
        yield from (f'{name}.{member}' for member in sorted(_members(exported)))


def _members(exported: type) -> Iterator[str]:
    """Yield fields, properties and methods, also inherited ones; methods with parameters."""
    fields = {field.name for field in dataclasses.fields(exported)
              } if dataclasses.is_dataclass(exported) else set()
    yield from (name for name in fields if not name.startswith('_'))
    inherited = [vars(base) for base in exported.__mro__
                 if base.__module__.startswith(core.__name__)]
    for name, member in ChainMap(*map(dict, inherited)).items():
        if name.startswith('_') or name in fields:
            continue
        function = inspect.unwrap(getattr(member, '__func__', member))
        yield f'{name}({_parameters(function)})' if inspect.isfunction(function) else name


def _parameters(function: Any) -> str:
    """Return the parameters of a function without types; `=` marks those that may be left out."""
    found = [parameter for parameter in inspect.signature(function).parameters.values()
             if parameter.name not in ('self', 'cls')]
    return ', '.join(item.name + '=' * (item.default is not item.empty) for item in found)


def adapter_names() -> Iterator[str]:
    """Yield functions and classes of the adapters, read without importing ROS."""
    for file in sorted((REPOSITORY / 'msg_adapters').glob('[!_]*.py')):
        if file.stem in INNER_ADAPTERS:
            continue
        for node in ast.parse(file.read_text(encoding='utf-8')).body:
            if getattr(node, 'name', '_').startswith('_'):
                continue
            if isinstance(node, ast.FunctionDef):
                yield f'{file.stem}.{node.name}({_written_parameters(node.args)})'
            elif isinstance(node, ast.ClassDef):
                yield f'{file.stem}.{node.name}'
                yield from (f'{file.stem}.{node.name}.{field}' for field in _fields(node))


def _written_parameters(arguments: ast.arguments) -> str:
    """Return the names of parameters as `_parameters` does."""
    places = [*arguments.posonlyargs, *arguments.args]
    first_default = len(places) - len(arguments.defaults)
    names = [item.arg + '=' * (place >= first_default) for place, item in enumerate(places)]
    return ', '.join(names + [item.arg + '=' * (default is not None) for item, default
                              in zip(arguments.kwonlyargs, arguments.kw_defaults)])


def _fields(node: ast.ClassDef) -> Iterator[str]:
    """Yield annotated fields and methods of a class."""
    for item in node.body:
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
            yield item.target.id
        elif isinstance(item, ast.FunctionDef) and not item.name.startswith('_'):
            yield f'{item.name}()'


def configuration_names() -> Iterator[str]:
    """Yield the presets and the keys of a configuration."""
    yield from (f'preset: {name}' for name in sorted(core.TrackerConfig.preset_names()))
    default = core.TrackerConfig.preset('default')
    for section in dataclasses.fields(default):
        value = getattr(default, section.name)
        if dataclasses.is_dataclass(value):
            yield from (f'{section.name}.{field.name}' for field in dataclasses.fields(value))
    yield from (f'features[].{field.name}' for field in dataclasses.fields(FeatureConfig))
    yield from (f'features[].channels[].{field.name}'
                for field in dataclasses.fields(ChannelConfig))


def command_names() -> Iterator[str]:
    """Yield the commands of `lmsco` with their arguments and options."""
    yield from _commands(typer.main.get_command(build_app()), 'lmsco')


def _commands(command: click.Command, path: str) -> Iterator[str]:
    """Yield the names of a command and of those below it."""
    for parameter in command.params:
        spelled = parameter.opts + parameter.secondary_opts
        yield f'{path} {" ".join(spelled) if spelled[0][0] == "-" else spelled[0].upper()}'
    for name, below in sorted(getattr(command, 'commands', {}).items()):
        yield f'{path} {name}'
        yield from _commands(below, f'{path} {name}')


def ros_names() -> Iterator[str]:
    """Yield topics, services and parameters of the node, as the README has them."""
    for heading in ('Topics', 'Services'):
        for name, *between, _ in _table(heading):
            yield ' '.join([heading.lower().rstrip('s'), name, *between])
    parameters = yaml.safe_load((REPOSITORY / 'config' / 'tracker.yaml').read_text())
    (node,) = parameters.values()
    yield from (f'parameter {name}' for name in node['ros__parameters'])


def _table(heading: str) -> list[list[str]]:
    """Return the cells of a table of the README."""
    readme = (REPOSITORY / 'README.md').read_text(encoding='utf-8')
    section = readme.split(f'\n## {heading}\n')[1].split('\n## ')[0]
    rows = [line for line in section.splitlines() if line.startswith('|')][2:]
    return [[cell.strip().strip('`') for cell in row.strip('|').split('|')] for row in rows]


def file_names() -> Iterator[str]:
    """Yield columns and keys of the files that are written."""
    yield 'boxes.csv: ' + ', '.join(COLUMNS)
    record = ('tracker', 'sequence', 'protocol', *Trace.unanswered(0, '').to_json())
    yield from (f'record: {key}' for key in record)
    yield from (f'run file: {key}' for key in ('protocol', 'context', 'records', 'sequences'))
    yield from (f'run file: sequences[].{field.name}'
                for field in dataclasses.fields(SequenceInfo))


SECTIONS = {
    'Python: lmsco_ros.core': python_names,
    'Python: msg_adapters': adapter_names,
    'Configuration': configuration_names,
    'Command line': command_names,
    'ROS': ros_names,
    'Files': file_names,
}


def page() -> str:
    """Return the whole page."""
    parts = (f'\n## {heading}\n\n```text\n' + '\n'.join(names()) + '\n```\n'
             for heading, names in SECTIONS.items())
    return HEAD + ''.join(parts)


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
