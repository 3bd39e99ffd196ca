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

"""Records, resumption, crashes and broken sequences, with real worker processes."""

from concurrent.futures import ThreadPoolExecutor
import errno
import json
import os

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.errors import DatasetError, EvaluationError, ResultError
from lmsco_ros.evaluation.jobs import Job
from lmsco_ros.evaluation.record_store import read_record, RecordStore
from lmsco_ros.evaluation.run_file import read_run, read_runs
from lmsco_ros.evaluation.runner import Evaluation
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.trackers import resolve
from lmsco_ros.evaluation.whole_file import write_json, write_whole
from lmsco_ros.evaluation.worker_pool import LocalProcesses

TRACK, MISS, LOSE, RAISE, DIE, REFUSE, WAIT, END, MUMBLE = range(9)


@pytest.fixture
def dataset(tmp_path, vot_folder):
    """Return a folder of three sequences, one of which kills the tracker's process."""
    root = tmp_path / 'data'
    vot_folder(root / 'calm', [TRACK] * 4)
    vot_folder(root / 'deadly', [TRACK, DIE, TRACK])
    vot_folder(root / 'rough', [TRACK, RAISE, TRACK])
    return root


@pytest.fixture
def evaluation(tmp_path, dataset, scripted):
    """Return a function that plans the evaluation of the dataset."""
    def plan(protocol='ope'):
        return Evaluation([resolve(scripted)], scan_dataset(dataset).sequences, protocol,
                          tmp_path / 'out')
    return plan


def test_an_interrupted_run_resumes_without_losing_or_repeating(tmp_path, evaluation):
    first = evaluation()
    assert len(first.pending) == 3
    running = first.run(LocalProcesses(1))
    done, _ = next(running)
    running.close()
    second = evaluation()
    assert [job.sequence.name for job in second.done] == [done.sequence.name]
    rest = [job.sequence.name for job, _ in second.run(LocalProcesses(2))]
    assert sorted([done.sequence.name, *rest]) == ['calm', 'deadly', 'rough']
    assert not evaluation().pending


def test_crashes_are_recorded_and_the_others_go_on(tmp_path, evaluation):
    plan = evaluation()
    list(plan.run(LocalProcesses(1)))
    plan.finish({'date': '2026-01-01'})
    run = read_run(tmp_path / 'out', 'ope')
    traces = dict(zip((sequence.name for sequence in run.sequences), run.traces['Scripted']))
    assert traces['calm'].error is None and np.isfinite(traces['calm'].boxes).all()
    assert 'exit code 7' in traces['deadly'].error
    assert 'stumbled' in traces['rough'].error
    assert run.context == {'date': '2026-01-01'}
    assert run.sequences[0].size == (64, 48)


def test_an_answer_that_is_none_is_a_crash(tmp_path, vot_folder, scripted):
    sequences = scan_dataset(vot_folder(tmp_path / 'seq', [TRACK, TRACK, MUMBLE])).sequences
    plan = Evaluation([resolve(scripted)], sequences, 'ope', tmp_path)
    ((_, outcome),) = plan.run(LocalProcesses(1))
    assert outcome.error.startswith('frame 2: ') and outcome.updates


def test_a_worker_that_somebody_ends_is_no_crash_of_its_tracker(tmp_path, vot_folder, scripted):
    vot_folder(tmp_path / 'data' / 'a', [TRACK] * 3)
    sequences = scan_dataset(vot_folder(tmp_path / 'data' / 'b', [TRACK, END]).parent).sequences
    plan = Evaluation([resolve(scripted)], sequences, 'ope', tmp_path / 'out')
    with pytest.raises(EvaluationError, match='a worker process was ended by SIGTERM'):
        list(plan.run(LocalProcesses(1)))
    again = Evaluation([resolve(scripted)], sequences, 'ope', tmp_path / 'out')
    assert [job.sequence.name for job in again.pending] == ['b']


def test_protocols_and_code_have_records_of_their_own(tmp_path, evaluation, dataset):
    list(evaluation().run(LocalProcesses(1)))
    assert len(evaluation('vot').pending) == 3
    module = tmp_path / 'modules' / 'scripted_tracker.py'
    module.write_text(module.read_text(encoding='utf-8') + '\n# changed\n', encoding='utf-8')
    assert len(evaluation().pending) == 3


def test_a_sequence_that_breaks_on_the_way_is_skipped_for_all(tmp_path, evaluation, dataset):
    (dataset / 'calm' / 'ir' / '00000003.png').write_bytes(b'no image')
    plan = evaluation()
    list(plan.run(LocalProcesses(1)))
    plan.finish({})
    assert [item.name for item in plan.skipped] == ['data/calm']
    assert '00000003.png' in plan.skipped[0].reason
    names = [sequence.name for sequence in read_run(tmp_path / 'out', 'ope').sequences]
    assert names == ['deadly', 'rough']


def test_a_run_of_broken_sequences_only_is_an_error(evaluation, dataset):
    for image in dataset.rglob('*.png'):
        image.write_bytes(b'no image')
    plan = evaluation()
    assert not plan.pending
    with pytest.raises(DatasetError, match='data/calm: 00000001.png is not a readable image'):
        plan.finish({})


def changed(**values):
    """Return what makes a record one with other values."""
    return lambda text: json.dumps({**json.loads(text), **values})


@pytest.mark.parametrize('damage', [
    lambda text: '', lambda text: text[:len(text) // 2], lambda text: '[]', lambda text: '{}',
    lambda text: 'null', lambda text: '[' * 100_000, lambda text: '\0' * 90,
    lambda text: text.replace('0.75', 'NaN', 1), lambda text: text.replace('0.75', '1e999', 1),
    lambda text: text.replace('"scores"', '"marks"'), lambda text: text.replace('0.75', '"0.75"'),
    changed(boxes=[[1, 2, 3, 4]]), changed(boxes=[[1, 2, 3]] * 4, scores=[0.5] * 4),
    changed(boxes=[[1, 2, 3, 4]] * 3, scores=[0.5] * 3), changed(scores=[True] * 4),
    changed(lost=[7]), changed(lost=[0.5]), changed(lost='0'), changed(starts=[-1]),
    changed(failures=None), changed(updates='3'), changed(wall_seconds=None),
    changed(cpu_seconds='fast'), changed(error=5), changed(tracker='Other'),
    changed(sequence='data/rough'), changed(protocol='vot'), changed(predicted=[None] * 4),
    changed(covariances=[None] * 4), changed(predicted=[None] * 3, covariances=[None] * 4),
    changed(predicted=[None] * 4, covariances=[[1] * 9] * 4),
    changed(predicted=[None] * 4, covariances=[['1'] * 10] * 4),
])
def test_damaged_records_are_made_again(tmp_path, vot_folder, scripted, damage):
    sequences = scan_dataset(vot_folder(tmp_path / 'data' / 'calm', [TRACK] * 4)).sequences
    store = RecordStore(tmp_path / 'out')
    job = Job(resolve(scripted), sequences[0], 'ope')
    boxes = sequences[0].ground_truth
    store.write(job, Trace(boxes, np.full(4, 0.75), np.zeros(4, bool), starts=(0,), updates=3))
    path = tmp_path / 'out' / store.path(job)
    sound = Evaluation([job.tracker], sequences, 'ope', tmp_path / 'out')
    assert (len(sound.done), len(sound.pending), sound.damaged) == (1, 0, [])
    path.write_text(damage(path.read_text(encoding='utf-8')), encoding='utf-8')
    plan = Evaluation([job.tracker], sequences, 'ope', tmp_path / 'out')
    assert (len(plan.done), len(plan.pending)) == (0, 1)
    (told,) = plan.damaged
    assert f'{path} is damaged (' in told and len(told) < len(str(path)) + 150


@given(cut=st.integers(0, 4000), insert=st.binary(max_size=6), remove=st.integers(0, 9))
def test_any_damage_is_a_result_error_or_none(tmp_path_factory, cut, insert, remove):
    path = tmp_path_factory.mktemp('records') / 'record.json'
    boxes = np.full((9, 4), 1.5)
    trace = Trace(boxes, np.ones(9), np.zeros(9, bool), starts=(0,), updates=8, predicted=boxes,
                  covariances=np.ones((9, 4, 4)))
    content = json.dumps(trace.to_json()).encode()
    path.write_bytes(content[:cut] + insert + content[cut + remove:])
    try:
        assert read_record(path).boxes.shape[1] == 4
    except ResultError as error:
        assert 'record.json is damaged' in str(error)


def test_records_keep_predictions_and_covariances(tmp_path):
    root = np.random.default_rng(3).normal(size=(5, 4, 4))
    covariances = root @ root.transpose(0, 2, 1)
    boxes = np.full((5, 4), 1.5)
    predicted = boxes + 0.123
    predicted[0] = covariances[0] = np.nan
    trace = Trace(boxes, np.ones(5), np.zeros(5, bool), (0,), predicted=predicted,
                  covariances=covariances)
    again = Trace.from_json(json.loads(json.dumps(trace.to_json())))
    np.testing.assert_allclose(again.predicted, predicted, rtol=1e-4)
    np.testing.assert_allclose(again.covariances, covariances, rtol=1e-4)
    silent = Trace(boxes, np.ones(5), np.zeros(5, bool), (0,)).to_json()
    assert silent['predicted'] is None and silent['covariances'] is None
    # Those of earlier versions have neither.
    del silent['predicted'], silent['covariances']
    assert Trace.from_json(silent).covariances is None


@pytest.mark.parametrize('damage', [
    lambda text: '', lambda text: text[:200], lambda text: '{', lambda text: '[1]',
    lambda text: '{}', changed(records=[]), changed(records={'Scripted': ['no/such.json'] * 3}),
    changed(records={'Scripted': []}), changed(records={'Scripted': [1, 2, 3]}),
    changed(sequences=[]), changed(sequences=[1]), changed(protocol='vot'), changed(context=[]),
    changed(context={'machine': 5}), changed(context={'anchors': {'length': 'far'}}),
    changed(context={'skipped': [{}]}), changed(context={'scenes': ['aerial']}),
    changed(context={'scenes': {'aerial': 'drone_ir'}}),
    lambda text: text.replace('"size": [64, 48]', '"size": [64]'),
    lambda text: text.replace('"challenge": ""', '"challenge": "of another version"'),
    lambda text: text.replace('"name": "calm"', '"name": 7'),
    lambda text: text.replace('"origin": null', '"origin": {"full_name": "a"}'),
])
def test_damaged_run_files_are_told_with_the_remedy(tmp_path, dataset, scripted, damage):
    sequences = scan_dataset(dataset).sequences
    store, tracker = RecordStore(tmp_path / 'out'), resolve(scripted)
    for sequence in sequences:
        store.write(Job(tracker, sequence, 'ope'), Trace.unanswered(len(sequence), 'away'))
    Evaluation([tracker], sequences, 'ope', tmp_path / 'out').finish({'machine': {}})
    path = tmp_path / 'out' / 'run-ope.json'
    assert read_run(tmp_path / 'out', 'ope').trackers == ('Scripted',)
    path.write_text(damage(path.read_text(encoding='utf-8')), encoding='utf-8')
    with pytest.raises(ResultError, match='(damaged|missing).*--protocol ope.*again'):
        read_run(tmp_path / 'out', 'ope')
    runs, complaints = read_runs(tmp_path / 'out')
    assert not runs and len(complaints) == 1


def test_files_are_complete_or_as_they_were(tmp_path):
    path = tmp_path / 'record.json'
    with pytest.raises(TypeError):
        write_json(path, {'value': object()})
    assert not list(tmp_path.iterdir())
    assert read_record(path) is None
    write_json(path, {'value': 1})
    with pytest.raises(TypeError):
        write_json(path, {'value': object()})
    assert json.loads(path.read_text(encoding='utf-8')) == {'value': 1}
    (tmp_path / 'link').symlink_to(path)
    write_whole(tmp_path / 'link', b'through it')
    assert path.read_bytes() == b'through it' and (tmp_path / 'link').is_symlink()
    with pytest.raises(OSError, match='record.json'):
        write_whole(path / 'inside', b'')


def test_a_disk_without_room_is_told_with_the_file(tmp_path, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, 'No space left on device')
    monkeypatch.setattr(os, 'replace', full)
    with pytest.raises(OSError, match='No space left on device.*page.md'):
        write_whole(tmp_path / 'page.md', b'text')
    assert not list(tmp_path.iterdir())


def test_a_reader_sees_one_writer_or_the_other(tmp_path):
    texts = [letter * size for letter, size in ((b'a', 1), (b'b', 70_000), (b'c', 900_000))]
    write_whole(tmp_path / 'page', texts[0])
    with ThreadPoolExecutor(3) as pool:
        writers = [pool.submit(lambda text: [write_whole(tmp_path / 'page', text)
                                             for _ in range(60)], text) for text in texts]
        while not all(writer.done() for writer in writers):
            assert (tmp_path / 'page').read_bytes() in texts
    assert not any(writer.exception() for writer in writers)
    assert [path.name for path in tmp_path.iterdir()] == ['page']
