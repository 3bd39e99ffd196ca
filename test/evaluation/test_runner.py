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

import json

import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.record_store import read_record, write_json
from lmsco_ros.evaluation.run_file import read_run
from lmsco_ros.evaluation.runner import Evaluation
from lmsco_ros.evaluation.trackers import resolve

TRACK, MISS, LOSE, RAISE, DIE, REFUSE = range(6)


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
    running = first.run(workers=1)
    done, _ = next(running)
    running.close()
    second = evaluation()
    assert [job.sequence.name for job in second.done] == [done.sequence.name]
    rest = [job.sequence.name for job, _ in second.run(workers=2)]
    assert sorted([done.sequence.name, *rest]) == ['calm', 'deadly', 'rough']
    assert not evaluation().pending


def test_crashes_are_recorded_and_the_others_go_on(tmp_path, evaluation):
    plan = evaluation()
    list(plan.run(workers=1))
    plan.finish({'date': '2026-01-01'})
    run = read_run(tmp_path / 'out', 'ope')
    traces = dict(zip((sequence.name for sequence in run.sequences), run.traces['Scripted']))
    assert traces['calm'].error is None and np.isfinite(traces['calm'].boxes).all()
    assert 'exit code 7' in traces['deadly'].error
    assert 'stumbled' in traces['rough'].error
    assert run.context == {'date': '2026-01-01'}
    assert run.sequences[0].size == (64, 48)


def test_protocols_and_code_have_records_of_their_own(tmp_path, evaluation, dataset):
    list(evaluation().run(workers=1))
    assert len(evaluation('vot').pending) == 3
    module = tmp_path / 'modules' / 'scripted_tracker.py'
    module.write_text(module.read_text(encoding='utf-8') + '\n# changed\n', encoding='utf-8')
    assert len(evaluation().pending) == 3


def test_a_sequence_that_breaks_on_the_way_is_skipped_for_all(tmp_path, evaluation, dataset):
    (dataset / 'calm' / 'ir' / '00000003.png').write_bytes(b'no image')
    plan = evaluation()
    list(plan.run(workers=1))
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


def test_records_are_complete_or_absent(tmp_path):
    with pytest.raises(TypeError):
        write_json(tmp_path / 'record.json', {'value': object()})
    assert not list(tmp_path.iterdir())
    assert read_record(tmp_path / 'record.json') is None
    write_json(tmp_path / 'record.json', {'value': 1})
    assert json.loads((tmp_path / 'record.json').read_text(encoding='utf-8')) == {'value': 1}
