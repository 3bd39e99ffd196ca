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

"""What docs/architecture.md says of rooms, modules and equations is what the code says."""

import ast
import importlib.util
from pathlib import Path
import re

import pytest

from benchmarks import frame_way

REPOSITORY = Path(__file__).resolve().parents[2]
CORE = REPOSITORY / 'lmsco_ros' / 'core'
PAGE = (REPOSITORY / 'docs' / 'architecture.md').read_text()
PICTURE_BYTES = 300_000
EQUATIONS = range(1, 13)


def section(heading):
    """Return the text below a heading, up to the next one."""
    return PAGE.split(f'\n## {heading}\n')[1].split('\n## ')[0]


def rows(text):
    """Return the cells of all rows of tables that begin with code or an equation's number."""
    return [[cell.strip() for cell in line.strip('|').split('|')]
            for line in text.splitlines() if re.match(r'\| (`|\(|\d)', line)]


def modules():
    """Return the path below the core, and the first line, of every module but package heads."""
    return {str(file.relative_to(CORE)): ast.get_docstring(ast.parse(file.read_text()))
            .split('\n')[0] for file in CORE.rglob('*.py') if file.name != '__init__.py'}


def definitions():
    """Return {path:qualified name: docstring} of every class and function of the core."""
    found = {}
    for file in CORE.rglob('*.py'):
        tree = ast.parse(file.read_text())
        for node in ast.walk(tree):
            for child in ast.iter_child_nodes(node):
                if isinstance(child, (ast.ClassDef, ast.FunctionDef)):
                    inside = f'{node.name}.' if isinstance(node, ast.ClassDef) else ''
                    found[f'{file.relative_to(CORE)}:{inside}{child.name}'] = (
                        ast.get_docstring(child) or '')
    return found


def mentioned(docstring):
    """Return the equations that a docstring names as those of the paper."""
    return {int(number) for number in re.findall(r'paper, \((\d+)\)', docstring)}


DEFINITIONS = definitions()
PLACES = [(int(number.strip('()')), place)
          for number, _, places in rows(section('From the paper to the code'))
          for place in re.findall(r'`([^`]+)`', places)]


def test_modules_and_their_first_lines_are_those_of_the_code():
    told = [(name.strip('`'), meaning) for name, meaning
            in rows(section('The rooms of the core').split('\nEvery module')[1])]
    assert dict(told) == modules() and len(told) == len(modules()), (
        'run: python scripts/module_table.py')


def test_rooms_have_the_levels_that_the_layers_have():
    path = Path(__file__).with_name('test_layers.py')
    spec = importlib.util.spec_from_file_location('layers', path)
    layers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(layers)
    told = {room.strip('`'): int(level) - 1 for level, room, _
            in rows(section('The rooms of the core').split('\nEvery module')[0])}
    assert told == layers.levels(layers.CORE)
    drawn = PAGE.split('```text\n')[1].split('```')[0].splitlines()
    installed = [set(line) for line in layers.PACKAGES
                 if not {'benchmarks', 'training'} & set(line)]
    assert [set(line.split()) for line in drawn] == installed


@pytest.mark.parametrize('number, place', PLACES)
def test_function_of_an_equation_names_it(number, place):
    assert number in mentioned(DEFINITIONS[place])


def test_every_equation_is_in_the_table():
    assert {number for number, _ in PLACES} == set(EQUATIONS)


def test_every_function_that_names_an_equation_is_in_the_table():
    named = {(number, place) for place, docstring in DEFINITIONS.items()
             for number in mentioned(docstring)}
    assert named == set(PLACES)


def test_named_functions_and_files_exist():
    for place in re.findall(r'`(\w+/\w+\.py:[\w.]+)`', PAGE):
        assert place in DEFINITIONS
    names = {place.split(':')[1] for place in DEFINITIONS}
    way = section("One frame's way")
    for name in set(re.findall(r'`([A-Za-z_]+(?:\.[a-z_]+)?)`', way)):
        assert name in names, name


def test_picture_is_there_and_small():
    assert (REPOSITORY / 'docs/images/frame_way.png').stat().st_size < PICTURE_BYTES


def test_picture_can_be_drawn_again(tmp_path):
    frame_way.main(['--output', str(tmp_path / 'way.png')])
    assert (tmp_path / 'way.png').stat().st_size > PICTURE_BYTES / 3
    for _, _, places in frame_way.STEPS:
        assert all((CORE / place).is_file() for place in places.split(', '))
