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
Whether the tests of the tracker's heart notice when it is changed.

Each small change of a module is made in a copy of the sources, and the tests of its room run on
it. What they do not notice is told, as a table:
python -m scripts.mutants [--module detection] [--sample 100 --seed 1] [--processes 2]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
import random
import sys
import tempfile
import time

from scripts.mutants.operators import Mutation, mutations
from scripts.mutants.workspace import Outcome, Workspace

REPOSITORY = Path(__file__).parents[2]
CONTENTS = ('lmsco_ros', 'test', 'setup.cfg')
MOST_SURVIVORS = 0.05
_CORE = 'lmsco_ros/core'
# A change may make the tests slower without making them endless, and so may a busy machine.
_PATIENCE, _LEAST_PATIENCE_SECONDS = 4.0, 60.0
_LONGEST_TEXT = 60


@dataclass(frozen=True)
class Room:
    """
    A part of the sources, and the tests that watch over it.

    Attributes
    ----------
    sources : str
        A module or a folder in the repository.
    tests : tuple of str
        Files and folders in the repository; what is quick comes first.

    """

    sources: str
    tests: tuple[str, ...]

    def modules(self, repository: Path) -> list[str]:
        """Return the paths of the modules in the repository."""
        path = repository / self.sources
        files = sorted(path.rglob('*.py')) if path.is_dir() else [path]
        return [str(file.relative_to(repository)) for file in files]


ROOMS = {
    'track': Room(f'{_CORE}/track.py', ('test/core/track',)),
    **{name: Room(f'{_CORE}/{name}', (f'test/core/{name}', 'test/core/track'))
       for name in ('search', 'presence', 'detection')}}


@dataclass(frozen=True)
class Trial:
    """A module with one change, and the tests that may notice it."""

    module: str
    mutation: Mutation
    tests: tuple[str, ...]


def trials(repository: Path, rooms: Iterable[Room], module: str = '') -> list[Trial]:
    """Return all changes of the modules in rooms; of those alone whose path holds `module`."""
    return [Trial(path, mutation, room.tests)
            for room in rooms for path in room.modules(repository) if module in path
            for mutation in mutations((repository / path).read_text(encoding='utf-8'))]


def outcomes(repository: Path, chosen: Sequence[Trial], processes: int,
             contents: Sequence[str] = CONTENTS) -> Iterator[Outcome]:
    """
    Yield what the tests made of each change, in their order.

    Parameters
    ----------
    repository : Path
        Sources and tests; they are copied and stay as they are.
    chosen : sequence of Trial
        The changes.
    processes : int
        How many are tried at a time.
    contents : sequence of str
        What is copied of the repository.

    Raises
    ------
    RuntimeError
        When the tests do not pass on the sources as they are.

    """
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(processes) as executor:
        free: SimpleQueue[Workspace] = SimpleQueue()
        for number in range(processes):
            folder = Path(scratch) / str(number)
            folder.mkdir()
            free.put(Workspace(repository, folder, contents))
        limits = {tests: _time_limit(repository, free, trial) for tests, trial in {
            trial.tests: trial for trial in chosen}.items()}

        def outcome(trial: Trial) -> Outcome:
            workspace = free.get()
            try:
                return workspace.try_out(trial.module, trial.mutation.source, trial.tests,
                                         limits[trial.tests])
            finally:
                free.put(workspace)

        yield from executor.map(outcome, chosen)


def _time_limit(repository: Path, free: SimpleQueue[Workspace], trial: Trial) -> float:
    """Return how long the tests may take, by how long they take without a change."""
    workspace, start = free.get(), time.monotonic()
    source = (repository / trial.module).read_text(encoding='utf-8')
    passed = workspace.try_out(trial.module, source, trial.tests)
    free.put(workspace)
    if passed is not Outcome.PASSED:
        raise RuntimeError(f'the tests {" ".join(trial.tests)} do not pass on the sources as '
                           'they are; see what pytest says of them')
    return max(_LEAST_PATIENCE_SECONDS, _PATIENCE * (time.monotonic() - start))


def report(chosen: Sequence[Trial], found: Sequence[Outcome]) -> str:
    """Return the table of what was not noticed, and the figures of each module."""
    survivors = [trial for trial, outcome in zip(chosen, found, strict=True)
                 if outcome is Outcome.PASSED]
    lines = ['| not noticed at | it was | it became |', '|---|---|---|']
    lines += [f'| {_place(trial)} | `{_short(trial.mutation.before)}` | '
              f'`{_short(trial.mutation.after)}` |' for trial in survivors]
    count, left = (Counter(trial.module for trial in some) for some in (chosen, survivors))
    lines += ['', '| module | changes | not noticed | share |', '|---|---:|---:|---:|']
    lines += [f'| {module} | {number} | {left[module]} | {left[module] / number:.1%} |'
              for module, number in count.items()]
    endless = sum(outcome is Outcome.ENDLESS for outcome in found)
    return '\n'.join([*lines, '', (
        f'{len(chosen)} changes, {len(survivors)} not noticed '
        f'({len(survivors) / len(chosen):.1%}), {endless} noticed by the time limit alone')])


def _place(trial: Trial) -> str:
    """Return where the change is, as editors take it."""
    return f'{trial.module}:{trial.mutation.line}'


def _short(text: str) -> str:
    """Return the text on one line of a table."""
    line = ' '.join(text.split()).replace('|', '\\|')
    return line if len(line) <= _LONGEST_TEXT else f'{line[:_LONGEST_TEXT]}...'


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when more than one in twenty changes goes unnoticed."""
    parser = argparse.ArgumentParser(prog='python -m scripts.mutants',
                                     description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('--module', default='', help='part of the path of the modules changed')
    parser.add_argument('--sample', type=int, help='how many changes are tried, drawn by chance')
    parser.add_argument('--seed', type=int, default=1, help='of the chance')
    parser.add_argument('--processes', type=int, default=2, help='at a time')
    options = parser.parse_args(arguments)
    chosen = trials(REPOSITORY, ROOMS.values(), options.module)
    if not chosen:
        parser.error(f'no module of {", ".join(ROOMS)} has {options.module!r} in its path')
    if options.sample is not None and options.sample < len(chosen):
        places = random.Random(options.seed).sample(range(len(chosen)), options.sample)
        chosen = [chosen[place] for place in sorted(places)]
    found = []
    for trial, outcome in zip(chosen, outcomes(REPOSITORY, chosen, options.processes),
                              strict=True):
        found.append(outcome)
        if outcome is Outcome.PASSED:
            print(f'{len(found)} of {len(chosen)}: {_place(trial)}', file=sys.stderr)
    print(report(chosen, found))
    return int(found.count(Outcome.PASSED) > MOST_SURVIVORS * len(chosen))


if __name__ == '__main__':
    sys.exit(main())
