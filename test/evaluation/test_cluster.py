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

"""Trackers on the workers of a Dask cluster: the same records, and whatever may end a worker."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import gc
import json
import os
from pathlib import Path
import re
import signal

import psutil
import pytest

from lmsco_ros.evaluation import cluster, cluster_worker
from lmsco_ros.evaluation.cluster import cluster_at, DaskCluster, local_cluster
from lmsco_ros.evaluation.cluster_worker import TrackerProcesses
from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.errors import EvaluationError
from lmsco_ros.evaluation.jobs import LeftOut
from lmsco_ros.evaluation.run_file import read_run
from lmsco_ros.evaluation.runner import Evaluation
from lmsco_ros.evaluation.trackers import resolve
from lmsco_ros.evaluation.worker_pool import LocalProcesses
from lmsco_ros.evaluation.worker_process import EndedError

distributed = pytest.importorskip('distributed', reason='needs the extra `cluster`')

TRACK, MISS, LOSE, RAISE, DIE, REFUSE, WAIT, END, MUMBLE, AXE = range(10)


@pytest.fixture
def plan(tmp_path, vot_folder, scripted):
    """Return a function that plans an evaluation of sequences by their commands."""
    def planned(output='out', names=(scripted,), protocol='ope', **sequences):
        for name, commands in sequences.items():
            if not (tmp_path / 'data' / name).exists():
                vot_folder(tmp_path / 'data' / name, commands)
        return Evaluation([resolve(name) for name in names],
                          scan_dataset(tmp_path / 'data').sequences, protocol, tmp_path / output)
    return planned


@pytest.fixture
def gate(tmp_path, monkeypatch):
    """Return the gate that trackers wait for, which opens at the end in any case."""
    path = tmp_path / 'gates' / 'open'
    path.parent.mkdir()
    monkeypatch.setenv('SCRIPTED_GATE', str(path))
    yield path
    path.touch()


@pytest.fixture
def waiting(gate, is_alive):
    """Return a function that finds the processes in which trackers wait that live."""
    def find():
        found = [int(path.name.split('-')[1]) for path in gate.parent.glob('waiting-*')]
        return [process for process in found if is_alive(process)]
    return find


def parent_of(process):
    """Return the parent of a process."""
    return int(Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()[1])


def outcomes(evaluation, engine):
    """Return what came of each sequence."""
    return {job.sequence.name: outcome for job, outcome in evaluation.run(engine)}


def records(folder):
    """Return all records but for the two times that were measured."""
    found = {}
    for path in sorted((folder / 'records').rglob('*.json')):
        content = json.loads(path.read_text(encoding='utf-8'))
        assert content.pop('wall_seconds') >= 0 and content.pop('cpu_seconds') >= 0
        found[str(path.relative_to(folder))] = content
    return found


MIXED = {'calm': [TRACK] * 6, 'lost': [TRACK, LOSE, MISS, TRACK], 'rough': [TRACK, RAISE],
         'deadly': [TRACK, DIE, TRACK]}


@pytest.mark.parametrize('protocol', ['ope', 'vot'])
def test_records_are_those_of_local_processes(plan, scripted, tmp_path, protocol):
    names = (scripted, 'default')
    with local_cluster(2) as engine:
        assert engine.at_once == 2 and engine.machine()['cores'].isdecimal()
        assert len(outcomes(plan('there', names, protocol, **MIXED), engine)) == len(MIXED)
    assert len(outcomes(plan('here', names, protocol), LocalProcesses(2))) == len(MIXED)
    assert len(records(tmp_path / 'here')) == len(names) * len(MIXED)
    assert records(tmp_path / 'there') == records(tmp_path / 'here')


@pytest.mark.parametrize('first_there', [True, False])
def test_a_run_that_was_broken_off_goes_on_with_another_engine(plan, first_there):
    evaluation = plan(**MIXED)
    with local_cluster(1) as there:
        first, second = (there, LocalProcesses()) if first_there else (LocalProcesses(), there)
        running = evaluation.run(first)
        done, _ = next(running)
        running.close()
        rest = outcomes(plan(), second)
    assert {done.sequence.name, *rest} == set(MIXED) and done.sequence.name not in rest


def test_a_worker_that_is_killed_costs_nothing_but_time(
        plan, gate, waiting, until, is_alive):
    evaluation = plan(waits=[TRACK, WAIT, TRACK], **MIXED)
    with local_cluster(2) as engine, ThreadPoolExecutor() as pool:
        running = pool.submit(outcomes, evaluation, engine)
        (process,) = until(waiting)
        os.kill(parent_of(process), signal.SIGKILL)
        until(lambda: not is_alive(process))
        until(waiting)
        gate.touch()
        found = running.result()
    assert set(found) == {'waits', *MIXED} and found['waits'].error is None
    assert not plan().pending


def test_what_kills_its_worker_twice_is_left_out_and_the_rest_is_not_blamed(plan, tmp_path):
    # With so many more sequences than workers, some wait in the workers that die.
    calm = {f's{number}': [TRACK] * 3 for number in range(10)}
    with local_cluster(2) as engine:
        evaluation = plan(axe=[TRACK, AXE], **calm)
        found = outcomes(evaluation, engine)
    left_out = found.pop('axe')
    assert isinstance(left_out, LeftOut) and set(found) == set(calm)
    assert re.match('[23] workers died while they ran Scripted on it', left_out.reason)
    assert all(outcome.error is None for outcome in found.values())
    evaluation.finish({})
    assert {item.name for item in evaluation.skipped} == {'data/axe'}
    assert {item.name for item in read_run(tmp_path / 'out', 'ope').sequences} == set(calm)
    assert {job.sequence.name for job in plan().pending} == {'axe'}


def test_a_process_that_somebody_ends_twice_is_no_crash_of_its_tracker(plan):
    with local_cluster(1) as engine:
        found = outcomes(plan(calm=[TRACK] * 3, ended=[TRACK, END]), engine)
    assert found['calm'].error is None
    assert 'ended by SIGTERM' in found['ended'].reason


@pytest.fixture
def hidden(plan):
    """Return an evaluation of a sequence whose images only this process sees."""
    evaluation = plan(calm=[TRACK] * 3)
    import scripted_tracker

    (job,) = evaluation.pending
    images = scripted_tracker.Here(job.sequence.frames)
    return evaluation, replace(job, sequence=replace(job.sequence, frames=images))


def test_a_worker_that_does_not_see_the_data_is_told_of(hidden):
    evaluation, job = hidden
    with local_cluster(1) as engine, pytest.raises(
            EvaluationError, match='cannot read the first frame of data/calm, which this machine'):
        list(engine.run([job]))


def test_a_sequence_that_nobody_can_read_is_left_out(plan, tmp_path):
    evaluation = plan(calm=[TRACK] * 3, torn=[TRACK] * 3)
    (tmp_path / 'data' / 'torn' / 'ir' / '00000001.png').write_bytes(b'no image')
    with local_cluster(1) as engine:
        found = outcomes(evaluation, engine)
    assert found['torn'] == LeftOut('00000001.png is not a readable image; repair or remove it')
    assert found['calm'].error is None


def test_a_worker_with_other_code_is_told_of(plan, monkeypatch):
    monkeypatch.setattr(cluster, 'identity', lambda tracker: ('newer', 'newer'))
    with local_cluster(1) as engine, pytest.raises(
            EvaluationError, match="has other code, settings or files of the tracker 'Scripted'"):
        outcomes(plan(calm=[TRACK] * 3), engine)


@pytest.fixture
def processes():
    """Return the processes of one worker as Dask sets them up."""
    made = TrackerProcesses()
    made.setup(None)
    yield made
    made.teardown(None)


def test_processes_are_kept_from_job_to_job_and_end_when_nobody_comes(
        plan, processes, until, monkeypatch):
    jobs = plan(one=[TRACK] * 3, two=[TRACK] * 3).pending
    assert all(processes.answer(job).error is None for job in jobs)
    ((process, timer),) = processes._idle
    timer.cancel()
    monkeypatch.setattr(cluster_worker, '_IDLE_SECONDS', 0.01)
    processes.answer(jobs[0])
    until(lambda: not process.lives)
    assert not processes._idle and processes.answer(jobs[0]).error is None


def test_an_idle_process_that_somebody_ends_costs_no_job(plan, processes, until):
    """As a machine does that runs out of memory."""
    one, two = plan(one=[TRACK] * 3, two=[TRACK] * 3).pending
    processes.answer(one)
    ((process, _),) = processes._idle
    os.kill(process._process.pid, signal.SIGKILL)
    until(lambda: not process.waits)
    assert processes.answer(two).error is None
    assert process._process.returncode == -signal.SIGKILL


def test_a_worker_that_closes_records_no_crash(plan, processes, waiting, until, is_alive):
    (job,) = plan(waits=[TRACK, WAIT]).pending
    with ThreadPoolExecutor() as pool:
        asked = pool.submit(processes.answer, job)
        (process,) = until(waiting)
        processes.teardown(None)
        with pytest.raises(EndedError, match='a worker was closed'):
            asked.result()
    assert not is_alive(process)


def test_the_command_uses_a_cluster_that_is_there_and_leaves_it_as_it_was(
        lmsco, plan, scripted, tmp_path):
    plan(axe=[TRACK, AXE], **MIXED)
    common = ('evaluate', tmp_path / 'data', '--tracker', scripted, '--output', tmp_path / 'out')
    with distributed.LocalCluster(
            2, threads_per_worker=1, host='127.0.0.1', dashboard_address='127.0.0.1:0') as there:
        words = ('--engine', 'dask', '--scheduler', there.scheduler_address)
        plugins = set(there.scheduler.worker_plugins)
        made = lmsco(*common, *words)
        assert made.exit_code == 0, made.output
        said = ' '.join(made.output.split())
        assert f'cluster {there.scheduler_address}, threads: 2, dashboard: http://' in said
        assert 'skipped data/axe: ' in said and 'workers died while they ran Scripted' in said
        assert set(there.scheduler.worker_plugins) == plugins and not there.scheduler.tasks
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert 'skipped data/axe' in page and '2 at a time' in page
    assert f'{len(MIXED)} results are there already, 1 to go' in lmsco(
        *common, '--engine', 'dask', '--jobs', 2).output


def test_without_an_answer_of_a_scheduler_the_command_says_so(
        lmsco, plan, scripted, tmp_path, monkeypatch):
    plan(calm=[TRACK] * 3)
    monkeypatch.setattr(cluster, '_CONNECT_SECONDS', 1)
    told = lmsco('evaluate', tmp_path / 'data', '--tracker', scripted, '--engine', 'dask',
                 '--scheduler', 'tcp://127.0.0.1:9', '--output', tmp_path / 'out')
    assert told.exit_code == 1 and 'Traceback' not in told.output
    assert 'no scheduler answers at tcp://127.0.0.1:9' in told.output


@pytest.mark.parametrize('words, reason', [
    (('--scheduler', 'tcp://127.0.0.1:9'), 'it goes with --engine dask'),
    (('--engine', 'dask', '--scheduler', 'tcp://127.0.0.1:9', '--jobs', 2), 'give one of them'),
    (('--shard', '3/2'), 'is no share; give its number and how many there are'),
    (('--shard', 'half'), 'is no share'),
    (('--shard', '2/2'), 'share 2/2 of 1 sequences is empty; make at most 1 of them'),
])
def test_what_makes_no_sense_is_misuse(lmsco, plan, scripted, tmp_path, words, reason):
    plan(calm=[TRACK] * 3)
    told = lmsco('evaluate', tmp_path / 'data', '--tracker', scripted, '--output',
                 tmp_path / 'out', *words)
    assert told.exit_code == 2 and reason in ' '.join(told.output.replace('│', '').split())


def test_a_scheduler_that_goes_away_ends_the_run_with_one_sentence(plan, waiting, until):
    evaluation = plan(waits=[TRACK, WAIT])
    with distributed.LocalCluster(
            1, threads_per_worker=1, host='127.0.0.1', dashboard_address=None) as there, \
            ThreadPoolExecutor() as pool:
        def run():
            with cluster_at(there.scheduler_address) as engine:
                outcomes(evaluation, engine)
        running = pool.submit(run)
        until(waiting)
        there.close()
        with pytest.raises(EvaluationError, match='the scheduler went away'):
            running.result()
    until(lambda: not waiting())


@pytest.mark.slow
def test_many_small_tasks_do_not_grow_the_scheduler(plan, tmp_path):
    evaluation = plan(**{f's{number:04}': [TRACK] * 2 for number in range(2000)})
    with distributed.LocalCluster(
            2, threads_per_worker=1, host='127.0.0.1', dashboard_address=None) as there, \
            distributed.Client(there, set_as_default=False) as client:
        engine, held, memory = DaskCluster(client), [], []
        for done, _ in enumerate(evaluation.run(engine), 1):
            held.append(len(there.scheduler.tasks))
            if done in (500, 2000):
                gc.collect()
                memory.append(psutil.Process().memory_info().rss)
        assert done == 2000
        assert max(held) <= cluster._FEWEST_SUBMITTED and not there.scheduler.tasks
    # The scheduler lives in this process, as does whoever asks it.
    assert memory[1] - memory[0] < 20e6
