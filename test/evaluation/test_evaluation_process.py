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

"""Evaluations as processes: interrupted, killed, resumed, and two at the same time."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

from lmsco_ros.evaluation.run_file import read_run

TRACK, WAIT = 0, 6
REPOSITORY = Path(__file__).resolve().parents[2]


class Evaluations:
    """
    Evaluations of one sequence that is soon done and one whose tracker waits for a gate.

    Attributes
    ----------
    output : Path
        Folder of all of them.

    """

    def __init__(self, folder, tracker, modules, until):
        self._until = until
        self.output = folder / 'out'
        self._gate = folder / 'gates' / 'open'
        self._gate.parent.mkdir()
        self._words = [sys.executable, '-m', 'lmsco_ros.cli.main', 'evaluate', folder / 'data',
                       '--tracker', tracker, '--output', self.output]
        self._environment = {**os.environ, 'SCRIPTED_GATE': str(self._gate),
                             'PYTHONPATH': f'{REPOSITORY}:{modules}'}
        self._started = []

    def start(self, *words):
        """Start an evaluation in a process group of its own, as a shell does."""
        process = subprocess.Popen(
            [*self._words, *words], env=self._environment, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, start_new_session=True,
            # A shell without job control has what it starts in the background ignore Ctrl-C.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
        self._started.append(process)
        return process

    def waiting(self, count=1):
        """Return, for trackers that wait, the numbers of their processes and helpers."""
        found = self._until(lambda: (names := list(self._gate.parent.glob('waiting-*')))
                            and len(names) == count and names)
        return [int(number) for path in found for number in path.name.split('-')[1:]]

    def records(self):
        """Return the names of the sequences that are done."""
        return {path.name.split('-')[1] for path in self.output.rglob('records/**/*.json')}

    def open(self):
        """Let all trackers go on."""
        self._gate.touch()

    def close(self):
        """End what a test that failed left behind."""
        self.open()
        for process in self._started:
            process.kill()
            process.wait()
            process.stdout.close()


@pytest.fixture
def evaluations(tmp_path, vot_folder, scripted, until):
    """Return evaluations of a dataset of two sequences."""
    vot_folder(tmp_path / 'data' / 'set' / 'calm', [TRACK] * 4)
    vot_folder(tmp_path / 'data' / 'set' / 'waits', [TRACK, WAIT, TRACK])
    made = Evaluations(tmp_path, scripted, tmp_path / 'modules', until)
    yield made
    made.close()


def whole(evaluations):
    """Return the run of both sequences, of which nothing crashed."""
    run = read_run(evaluations.output, 'ope')
    assert [item.name for item in run.sequences] == ['calm', 'waits']
    assert not run.crashes('Scripted')
    assert (evaluations.output / 'report.html').read_text(encoding='utf-8').endswith('</html>')
    return run


ENGINES = pytest.mark.parametrize('engine', ['local', 'dask'])


@ENGINES
def test_killed_evaluation_goes_on_where_it_was(evaluations, engine, until, is_alive):
    first = evaluations.start('--engine', engine)
    workers = evaluations.waiting()
    until(lambda: evaluations.records() == {'calm'})
    first.kill()
    until(lambda: not any(map(is_alive, workers)))
    assert evaluations.records() == {'calm'}
    evaluations.open()
    said, _ = (second := evaluations.start()).communicate()
    assert second.returncode == 0, said
    assert '1 results are there already, 1 to go' in said
    whole(evaluations)


@ENGINES
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP],
                         ids=lambda number: number.name)
def test_ended_evaluation_keeps_what_was_finished_and_says_so(
        evaluations, number, engine, until, is_alive):
    first = evaluations.start('--engine', engine)
    workers = evaluations.waiting()
    until(lambda: evaluations.records() == {'calm'})
    os.killpg(first.pid, number)
    said, _ = first.communicate()
    assert first.returncode == 128 + number and 'Traceback' not in said
    assert f'1 of 2 results are kept in {evaluations.output}' in ' '.join(said.split())
    assert 'the same command goes on from there' in ' '.join(said.split())
    until(lambda: not any(map(is_alive, workers)))
    assert evaluations.records() == {'calm'}
    evaluations.open()
    said, _ = (second := evaluations.start()).communicate()
    assert second.returncode == 0 and '1 results are there already, 1 to go' in said
    whole(evaluations)


def test_two_evaluations_into_one_folder_do_no_harm(evaluations):
    both = [evaluations.start(), evaluations.start()]
    evaluations.waiting(2)
    evaluations.open()
    for process in both:
        said, _ = process.communicate()
        assert process.returncode == 0, said
        whole(evaluations)
    assert not list(evaluations.output.rglob('*.partial'))
