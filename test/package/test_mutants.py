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

"""The changes that the tests of the heart should notice, and the command that tries them."""

import ast
from pathlib import Path
import subprocess

import pytest

from scripts.mutants import __main__ as command
from scripts.mutants.operators import Mutation, mutations
from scripts.mutants.workspace import Outcome, Workspace

REPOSITORY = Path(__file__).resolve().parents[2]

MODULE = """\
# A door.
def may_enter(age, sober=True):
    if not sober:
        return False
    return age >= 18


def told(age):
    return 'welcome' if may_enter(age) else 'sorry'
"""
TESTS = """\
from tiny.door import may_enter, told


def test_grown_up_may_enter():
    assert may_enter(18) is True and may_enter(17) is False
    assert told(30) == 'welcome' and told(3) == 'sorry'


def test_drunkard_may_not():
    assert may_enter(40, sober=False) is False
"""


def changes(source):
    """Return what stood and what stands at each place that is changed."""
    return [(mutation.before, mutation.after) for mutation in mutations(source)]


@pytest.mark.parametrize('source, expected', [
    ('a < b', {('a < b', 'a <= b'), ('a < b', 'a >= b')}),
    ('a >= b', {('a >= b', 'a > b'), ('a >= b', 'a < b')}),
    ('a == b', {('a == b', 'a != b')}),
    ('a is not b', {('a is not b', 'a is b')}),
    ('a in b', {('a in b', 'a not in b')}),
    ('a + b', {('a + b', 'a - b')}),
    ('a / b', {('a / b', 'a * b')}),
    ('a ** b', {('a ** b', 'a * b')}),
    ('a @ b', set()),
    ('a and b', {('a and b', 'a or b')}),
    ('not a', {('not a', 'a')}),
    ('-a', {('-a', 'a')}),
    ('x = 3', {('3', '4')}),
    ('x = 0.5', {('0.5', '0.75')}),
    ('x = 0.0', {('0.0', '1.0')}),
    ('x = True', {('True', 'False')}),
    ('x = None', set()),
    ('a if b else c', {('a if b else c', 'a if not b else c')}),
    ('self.x = a', {('self.x = a', 'pass')}),
    ('x += a', {('x += a', 'pass')}),
    ('f()', {('f()', 'pass')}),
    ('x = f(a, b)', {('f(a, b)', 'f(b, a)')}),
    ('x = f(a, b, c)', {('f(a, b, c)', 'f(b, a, c)'), ('f(a, b, c)', 'f(a, c, b)')}),
    ('x = f(a, a)', set()),
    ('x = f(k=a)', {('f(k=a)', 'f()')}),
    ('def f(): return a', {('return a', 'return None')}),
    ('def f(): return None', set()),
    ('def f(): return', set()),
    ('def f(): return False', {('False', 'True')}),
])
def test_small_changes(source, expected):
    assert set(changes(source)) == expected


@pytest.mark.parametrize('source', [
    '"""Words."""', '__all__ = ["a"]', 'from a import b', 'x = f"{3}"', 'x = min(a, b)',
    'x = zip(a, strict=True)', 'assert a < 3', 'if TYPE_CHECKING:\n    x = 3',
    'x: Literal[3]', 'def f(x: Literal[3]) -> Literal[4]: pass',
    '@dataclass(frozen=True)\nclass A: pass'])
def test_what_means_nothing_stays(source):
    assert changes(source) == []


def test_only_one_thing_is_changed_at_a_time():
    found = [(change.line, change.before, change.after) for change in mutations(MODULE)]
    assert found == [
        (2, 'True', 'False'), (3, 'not sober', 'sober'),
        (4, 'False', 'True'),
        (5, 'return age >= 18', 'return None'), (5, 'age >= 18', 'age > 18'),
        (5, 'age >= 18', 'age < 18'), (5, '18', '19'),
        (9, "return 'welcome' if may_enter(age) else 'sorry'", 'return None'),
        (9, "'welcome' if may_enter(age) else 'sorry'",
         "'welcome' if not may_enter(age) else 'sorry'")]
    plain = ast.unparse(ast.parse(MODULE)).splitlines()
    for mutation in mutations(MODULE):
        changed = mutation.source.splitlines()
        assert sum(one != other for one, other in zip(plain, changed, strict=True)) == 1


@pytest.fixture
def repository(tmp_path):
    """Return a repository with one module and its tests."""
    for name, text in {'tiny/__init__.py': '', 'tiny/door.py': MODULE,
                       'test/test_door.py': TESTS, 'setup.cfg': '[tool:pytest]\n'}.items():
        path = tmp_path / 'repository' / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / 'repository'


CONTENTS = ('tiny', 'test', 'setup.cfg')
ROOM = command.Room('tiny/door.py', ('test',))


def test_what_the_tests_do_not_notice_is_told(repository):
    """Nobody asks for somebody who is drunk by default."""
    chosen = command.trials(repository, [ROOM])
    found = list(command.outcomes(repository, chosen, 2, CONTENTS))
    assert found == [Outcome.NOTICED] * len(chosen)
    # Without its second test, all of what is done with a drunkard goes unnoticed.
    (repository / 'test' / 'test_door.py').write_text(TESTS.split('def test_drunkard')[0])
    found = list(command.outcomes(repository, chosen, 1, CONTENTS))
    left = [trial.mutation for trial, outcome in zip(chosen, found, strict=True)
            if outcome is Outcome.PASSED]
    assert [(mutation.line, mutation.before) for mutation in left] == [(4, 'False')]
    assert (repository / 'tiny' / 'door.py').read_text() == MODULE
    lines = command.report(chosen, found).splitlines()
    assert '| tiny/door.py:4 | `False` | `True` |' in lines
    assert f'| tiny/door.py | {len(chosen)} | 1 | {1 / len(chosen):.1%} |' in lines


def test_tests_that_fail_anyway_are_an_error(repository):
    (repository / 'test' / 'test_door.py').write_text('def test_nothing(): assert False\n')
    with pytest.raises(RuntimeError, match='the tests test do not pass on the sources as they'):
        list(command.outcomes(repository, command.trials(repository, [ROOM]), 1, CONTENTS))


def test_endless_change_is_ended(repository, tmp_path):
    folder = tmp_path / 'copy'
    folder.mkdir()
    workspace = Workspace(repository, folder, CONTENTS)
    assert workspace.try_out('tiny/door.py', 'while True: pass', ['test'], 1.0) is Outcome.ENDLESS
    # The copy is as it was.
    assert workspace.try_out('tiny/door.py', MODULE, ['test']) is Outcome.PASSED
    assert (folder / 'tiny' / 'door.py').read_text() == MODULE


def test_modules_of_a_folder_are_chosen_by_a_part_of_their_path(repository):
    (repository / 'tiny' / 'window.py').write_text('x = 3\n')
    room = command.Room('tiny', ('test',))
    assert len(command.trials(repository, [room])) == len(mutations(MODULE)) + 1
    trial, = command.trials(repository, [room], 'window')
    assert trial == command.Trial('tiny/window.py', Mutation(1, '3', '4', 'x = 4'), ('test',))


def test_rooms_and_their_tests_are_there():
    for room in command.ROOMS.values():
        assert room.modules(REPOSITORY)
        for path in (room.sources, *room.tests):
            assert (REPOSITORY / path).exists()


@pytest.fixture
def tried(monkeypatch):
    """Let one change in `every` go unnoticed, and return the list of what is tried."""
    tried = []

    def prepare(every):
        def outcomes(repository, chosen, processes):
            tried.append(chosen)
            return iter([Outcome.NOTICED if n % every else Outcome.PASSED
                         for n in range(len(chosen))])
        monkeypatch.setattr(command, 'outcomes', outcomes)
        return tried
    return prepare


@pytest.mark.parametrize('every, status', [(10, 1), (20, 0)])
def test_status_says_whether_more_than_one_in_twenty_goes_unnoticed(tried, capsys, every, status):
    tried(every)
    assert command.main(['--sample', '100']) == status
    assert f'100 changes, {100 // every} not noticed' in capsys.readouterr().out


def test_sample_is_drawn_by_the_seed(tried):
    chosen = tried(50)
    for seed in ('1', '1', '2'):
        command.main(['--module', 'presence', '--sample', '40', '--seed', seed])
    assert chosen[0] == chosen[1] != chosen[2]
    assert all('/presence/' in trial.module for trial in chosen[2]) and len(chosen[2]) == 40


def test_unknown_module_is_refused(capsys):
    with pytest.raises(SystemExit):
        command.main(['--module', 'cellar'])
    said = capsys.readouterr().err
    assert "no module of track, search, presence, detection has 'cellar'" in said


def test_make_runs_it():
    done = subprocess.run(['make', '-n', 'mutants', 'MUTANTS_ARGS=--sample 3'], cwd=REPOSITORY,
                          capture_output=True, text=True)
    assert '-m scripts.mutants --sample 3' in done.stdout
