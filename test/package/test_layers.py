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

"""The rooms of the house: every import points down, and no room is entered from below."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]

# From the top down; what stands on one line does not know of its neighbors.
PACKAGES = (
    ('benchmarks',), ('training',), ('cli',), ('console',), ('replay',), ('evaluation', 'node'),
    ('visualization', 'msg_adapters'), ('synthetic', 'media'), ('core',),
    ('extras',))
CORE = (
    ('tracker',), ('targets',), ('track',), ('search',), ('presence',), ('detection',),
    ('extent', 'features', 'state'), ('weights', 'learning'), ('imaging', 'fourier'),
    ('config', 'networks', 'backend', 'types'), ('errors',))
MOST_ROOMS = 18
# ROS, and what needs it.
ABOVE_THE_CORE = ('rclpy', '_msgs', '_interfaces', 'std_srvs', 'msg_adapters')


def imports(file: Path) -> Iterator[str]:
    """Yield the full names of all that a file imports, in functions too."""
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.ImportFrom):
            yield from (f'{node.module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def room_of(name: str, prefix: str) -> str:
    """Return the room that a module belongs to, or the name of a package beside this one."""
    beside = prefix == 'lmsco_ros.' and not name.startswith(prefix)
    return name.split('.')[0] if beside else name.partition(prefix)[2].split('.')[0]


def levels(rooms: tuple[tuple[str, ...], ...]) -> dict[str, int]:
    """Return how far below the top each room is."""
    return {room: level for level, names in enumerate(rooms) for room in names}


def objections(folder: Path, room: str, prefix: str,
               rooms: tuple[tuple[str, ...], ...]) -> Iterator[str]:
    """Yield the imports of a room that do not point down."""
    below = levels(rooms)
    files = folder.rglob('*.py') if folder.is_dir() else [folder.with_suffix('.py')]
    for file in files:
        for name in imports(file):
            other = room_of(name, prefix)
            if other in below and other != room and below[other] <= below[room]:
                yield f'{file.relative_to(REPOSITORY)} imports {name}'


@pytest.mark.parametrize('package', levels(PACKAGES))
def test_packages_know_only_what_is_below_them(package):
    folder = next((REPOSITORY / place for place in (f'lmsco_ros/{package}', package)
                   if (REPOSITORY / place).is_dir()), REPOSITORY / 'lmsco_ros' / package)
    assert not list(objections(folder, package, 'lmsco_ros.', PACKAGES))


@pytest.mark.parametrize('room', levels(CORE))
def test_rooms_of_the_core_know_only_what_is_below_them(room):
    folder = REPOSITORY / 'lmsco_ros' / 'core' / room
    assert not list(objections(folder, room, 'lmsco_ros.core.', CORE))


def test_every_room_of_the_core_has_its_place():
    core = REPOSITORY / 'lmsco_ros' / 'core'
    rooms = {file.relative_to(core).with_suffix('').parts[0] for file in core.rglob('*.py')}
    rooms -= {'__init__'}
    assert rooms == set(levels(CORE)) and len(rooms) <= MOST_ROOMS


def test_every_package_has_its_place():
    packages = {path.parent.name for path in (REPOSITORY / 'lmsco_ros').glob('*/__init__.py')}
    assert packages <= set(levels(PACKAGES))


def test_the_core_knows_no_ros():
    for file in (REPOSITORY / 'lmsco_ros' / 'core').rglob('*.py'):
        tops = {name.split('.')[0] for name in imports(file)}
        assert not [top for top in tops if top.endswith(ABOVE_THE_CORE)], file


def test_an_import_that_points_up_is_seen(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), 'REPOSITORY', tmp_path)
    (tmp_path / 'fourier.py').write_text('def f():\n    from lmsco_ros.core.track import Track\n')
    found = list(objections(tmp_path / 'fourier', 'fourier', 'lmsco_ros.core.', CORE))
    assert found == ['fourier.py imports lmsco_ros.core.track.Track']
