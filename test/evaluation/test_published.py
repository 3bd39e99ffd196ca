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

"""Figures that others published, in the tables beside trackers that were run."""

import numpy as np
import pytest

from lmsco_ros.evaluation.errors import DatasetError, RequestError
from lmsco_ros.evaluation.published import (
    published_note, PublishedFile, read_published, summarize_published)
from lmsco_ros.evaluation.run_file import read_run

TRACK = 0
AUC = """tracker,mean,calm,set/fast,elsewhere
ECO-TIR,.7,.9,.5,.1
"Deep, shallow",.2,.2,,.3

Nobody,.4,,,.4
"""


@pytest.fixture
def auc(tmp_path):
    """Return a file of published figures."""
    path = tmp_path / 'auc.csv'
    path.write_text(AUC, encoding='utf-8')
    return path


@pytest.fixture
def words(tmp_path, vot_folder, scripted):
    """Return the command that evaluates two sequences."""
    for name in ('calm', 'fast'):
        vot_folder(tmp_path / 'data' / 'set' / name, [TRACK] * 4)
    return 'evaluate', tmp_path / 'data', '--tracker', scripted, '--output', tmp_path / 'out'


def test_file_is_read_by_its_names(auc):
    file = read_published('success_auc', auc)
    assert (file.figure, file.source) == ('success_auc', 'auc.csv')
    assert file.values['ECO-TIR'] == {'calm': .9, 'set/fast': .5, 'elsewhere': .1}
    assert np.isnan(file.values['Deep, shallow']['set/fast'])


@pytest.mark.parametrize('content, reason', [
    ('', 'has no header tracker,SEQUENCE'),
    ('name,calm\nA,.5\n', 'has no header'),
    ('tracker,calm,calm\nA,.5,.5\n', 'has no header'),
    ('tracker,calm\nA,.5\nA,.5\n', "row 3: 'A' has 2 cells"),
    ('tracker,calm\nA,.5,.6\n', 'has 3 cells where the header has 2'),
    ('tracker,calm\nA,50.3\n', "row 2: '50.3' is no share from 0 to 1"),
    ('tracker,calm\nA,good\n', "'good' is no share"),
    ('tracker,calm\nA,nan\n', "'nan' is no share")])
def test_other_content_is_refused(tmp_path, content, reason):
    (tmp_path / 'auc.csv').write_text(content, encoding='utf-8')
    with pytest.raises(RequestError, match=reason):
        read_published('success_auc', tmp_path / 'auc.csv')


def test_unknown_figures_and_files_are_told(tmp_path):
    with pytest.raises(RequestError, match="no figure 'speed'; known are success_auc, precision"):
        read_published('speed', tmp_path / 'auc.csv')
    with pytest.raises(RequestError, match='cannot be read'):
        read_published('success_auc', tmp_path / 'auc.csv')


def test_published_trackers_stand_in_tables_and_differences(lmsco, words, auc, tmp_path):
    precision = tmp_path / 'p.csv'
    precision.write_text('tracker,calm,fast\nECO-TIR,.4,.6\n', encoding='utf-8')
    peers = ('--published', f'success_auc={auc}', '--published', f'precision_20={precision}')
    made = lmsco(*words, *peers)
    assert made.exit_code == 0, made.output
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert 'ECO-TIR (published)' in page and 'Deep, shallow (published)' in page
    assert 'Nobody' not in page and 'Trackers marked (published) were not run here' in page
    table = tmp_path / 'results.md'
    assert lmsco('results', tmp_path / 'out', '--page', table, *peers).exit_code == 0
    text = table.read_text(encoding='utf-8')
    assert '| ECO-TIR (published) | .700 (.500 – .900) | – | .500 (.400 – .600) | – | – | – |' \
        in text
    assert 'published for 1 of these 2 sequences' in text
    run = read_run(tmp_path / 'out', 'ope')
    eco, _ = summarize_published(run, [read_published('success_auc', auc)])
    assert eco.aucs.tolist() == [.9, .5]
    assert '| ECO-TIR (published) | −' in text.split('Paired difference to Scripted')[1]
    without = tmp_path / 'without.md'
    assert lmsco('results', tmp_path / 'out', '--page', without).exit_code == 0
    assert '(published)' not in without.read_text(encoding='utf-8')


def test_figures_of_other_sequences_are_no_peers(lmsco, words, tmp_path):
    assert lmsco(*words).exit_code == 0
    file = PublishedFile('success_auc', 'far.csv', {'ECO': {'elsewhere': .5}})
    others = summarize_published(read_run(tmp_path / 'out', 'ope'), [file])
    assert others == ()
    assert published_note([file], others) == (
        'Nothing is published in far.csv of these sequences.')


def test_published_figures_are_of_whole_sequences(lmsco, words, auc, tmp_path):
    peers = ('--published', f'success_auc={auc}')
    told = lmsco(*words, '--frames', 3, *peers)
    assert told.exit_code == 2 and 'leave out --frames or --published' in told.output
    assert lmsco(*words, '--frames', 3).exit_code == 0
    with pytest.raises(DatasetError, match='this run is of the first 3 frames'):
        summarize_published(read_run(tmp_path / 'out', 'ope'),
                            [read_published('success_auc', auc)])
    assert lmsco(*words, '--published', auc).exit_code == 2
    assert lmsco(*words, '--challenge', 'telemetry', *peers).exit_code == 0
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert '(published)</td>' not in page


def test_figures_of_the_benchmark_of_thermal_tracking_are_read(test_data):
    folder = test_data / 'published'
    if not folder.is_dir():
        pytest.skip('needs published figures')
    file = read_published('success_auc', folder / 'lsotb_tir_auc_per_tracker_per_sequence.csv')
    assert len(file.values) == 37 and all(len(item) == 120 for item in file.values.values())
