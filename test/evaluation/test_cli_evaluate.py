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

"""The two commands, from the command line to the files they leave."""

import json

import cv2
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from lmsco_ros.cli import evaluate, results
from lmsco_ros.evaluation.merging import merged_run

TRACK, MISS, DIE = 0, 1, 4


@pytest.fixture
def lmsco():
    """Return a function that runs the commands of this module."""
    app = typer.Typer()
    evaluate.register(app)
    results.register(app)

    def run(*words):
        return CliRunner().invoke(app, [str(word) for word in words])
    return run


@pytest.fixture
def dataset(tmp_path, vot_folder):
    """Return a folder of two good sequences and one that is broken."""
    root = tmp_path / 'data'
    vot_folder(root / 'vot_tir' / 'steady', [TRACK] * 12)
    vot_folder(root / 'vot_tir' / 'rough', [TRACK, TRACK, MISS] + [TRACK] * 9)
    (vot_folder(root / 'vot_tir' / 'torn', [TRACK] * 3) / 'ir' / '00000002.png').unlink()
    return root


def test_evaluate_then_results(lmsco, dataset, scripted, tmp_path):
    output = tmp_path / 'out'
    common = ('evaluate', dataset, '--tracker', scripted, '--output', output)
    first = lmsco(*common, '--jobs', 2)
    assert first.exit_code == 0, first.output
    assert 'skipped vot_tir/torn: 2 frames but 3 rows' in first.output
    page = (output / 'report.html').read_text(encoding='utf-8')
    assert 'steady' in page and 'rough' in page and 'torn' in page
    second = lmsco(*common)
    assert '2 results are there already, 0 to go' in second.output
    third = lmsco(*common, '--protocol', 'vot')
    assert 'failures: 1' in third.output
    assert 'id="supervised"' in (output / 'report.html').read_text(encoding='utf-8')
    table = tmp_path / 'docs' / 'results.md'
    written = lmsco('results', output, '--page', table)
    assert written.exit_code == 0, written.output
    assert '| Scripted |' in table.read_text(encoding='utf-8')


@pytest.mark.parametrize('protocol', ['ope', 'vot', 'anchors'])
def test_a_process_that_died_has_its_place_in_the_report(lmsco, dataset, scripted, tmp_path,
                                                         vot_folder, protocol):
    vot_folder(dataset / 'vot_tir' / 'deadly', [TRACK, DIE] + [TRACK] * 3)
    output = tmp_path / 'out'
    made = lmsco('evaluate', dataset, '--tracker', scripted, '--output', output,
                 '--protocol', protocol)
    assert made.exit_code == 0, made.output
    page = (output / 'report.html').read_text(encoding='utf-8')
    assert 'Scripted crashed on vot_tir/deadly' in page and 'exit code 7' in page


@pytest.mark.parametrize('words', [(), ('--protocol', 'anchors', '--every', 4),
                                   ('--challenge', 'telemetry', '--challenge', 'dead_pixels')])
def test_shares_make_the_results_of_all_sequences(lmsco, dataset, scripted, tmp_path, vot_folder,
                                                  words):
    for number in range(4):
        vot_folder(dataset / 'other' / f'clip{number}', [TRACK] * (4 + number))
    common = ('evaluate', dataset, '--tracker', scripted, *words)
    for share in ('1/3', '2/3', '3/3'):
        made = lmsco(*common, '--shard', share, '--output', tmp_path / share[0])
        assert made.exit_code == 0, made.output
    assert lmsco(*common, '--output', tmp_path / 'all').exit_code == 0
    protocol = 'anchors' if '--every' in words else 'ope'
    shares = [tmp_path / number for number in '231']
    merged, whole = merged_run(shares, protocol), merged_run([tmp_path / 'all'], protocol)
    assert [item.full_name for item in merged.sequences] == [
        item.full_name for item in whole.sequences]
    for one, other in zip(merged.traces['Scripted'], whole.traces['Scripted']):
        np.testing.assert_array_equal(one.boxes, other.boxes)
    assert '--shard 2/3' in (tmp_path / '2' / 'report.html').read_text(encoding='utf-8')
    page = tmp_path / 'results.md'
    assert lmsco('results', *shares, '--page', page).exit_code == 0
    assert '--shard' not in page.read_text(encoding='utf-8')


def test_folders_that_do_not_make_one_table_are_told(lmsco, dataset, scripted, tmp_path):
    common = ('evaluate', dataset, '--tracker')
    assert lmsco(*common, scripted, '--output', tmp_path / 'one').exit_code == 0
    assert lmsco(*common, 'hcs', '--shard', '2/2', '--output', tmp_path / 'two').exit_code == 0
    told = lmsco('results', tmp_path / 'one', tmp_path / 'two', '--page', tmp_path / 'page.md')
    assert told.exit_code == 1 and 'no folder has hcs on vot_tir/rough; tables' in told.output
    assert lmsco(*common, scripted, '--frames', 5, '--output', tmp_path / 'cut').exit_code == 0
    told = lmsco('results', tmp_path / 'one', tmp_path / 'cut', '--page', tmp_path / 'page.md')
    assert told.exit_code == 1 and 'has another vot_tir/' in told.output


def test_several_starts_from_the_command_to_the_tables(lmsco, dataset, scripted, tmp_path,
                                                       vot_folder):
    boxes = [(0, 12, 10, 8)] + [(8 + index, 12, 10, 8) for index in range(11)]
    vot_folder(dataset / 'vot_tir' / 'enters', [TRACK] * 12, boxes)
    output = tmp_path / 'out'
    common = ('evaluate', dataset, '--tracker', scripted, '--output', output,
              '--protocol', 'anchors', '--every', 4)
    first = lmsco(*common, '--jobs', 2)
    assert first.exit_code == 0, first.output
    assert 'AUC entering' in first.output and 'skipped vot_tir/torn' in first.output
    assert {path.name.rpartition('-')[0] for path in output.rglob('records/**/*.json')} == {
        f'vot_tir-{name}_{span}' for name in ('steady', 'rough', 'enters')
        for span in ('0-11', '4-11', '8-0')}
    again = lmsco(*common)
    assert '9 results are there already, 0 to go' in again.output
    shorter = lmsco(*common, '--length', 4)
    assert '9 results are there already' not in shorter.output
    page = (output / 'report.html').read_text(encoding='utf-8')
    assert '3 sequences, 9 starts, 36 frames' in page and 'Entering and in view' in page
    assert '--protocol anchors --every 4 --length 4' in page
    table = tmp_path / 'results.md'
    assert lmsco('results', output, '--page', table).exit_code == 0
    text = table.read_text(encoding='utf-8')
    assert '### Several starts' in text and '| tracker | entering: starts |' in text
    assert '- sequences: vot_tir/enters, vot_tir/rough, vot_tir/steady\n' in text


def test_pages_keep_their_pictures_when_several_starts_follow(lmsco, dataset, scripted, tmp_path):
    output = tmp_path / 'out'
    common = ('evaluate', dataset, '--tracker', scripted, '--output', output)
    assert lmsco(*common).exit_code == 0
    assert lmsco(*common, '--protocol', 'anchors').exit_code == 0
    page = (output / 'report.html').read_text(encoding='utf-8')
    assert 'first frame of steady' in page
    assert 'id="one-pass"' in page and 'id="anchors"' in page


def test_challenges_have_records_and_tables_of_their_own(lmsco, dataset, scripted, tmp_path):
    output = tmp_path / 'out'
    common = ('evaluate', dataset, '--tracker', scripted, '--output', output)
    assert lmsco(*common).exit_code == 0
    made = lmsco(*common, '--challenge', 'telemetry', '--challenge', 'disappear_1s',
                 '--challenge', 'dead_pixels')
    assert made.exit_code == 0, made.output
    assert 'results are there already' not in made.output
    assert 'skipped vot_tir/steady+disappear_1s: 12 frames; this challenge needs' in made.output
    names = {path.name.rpartition('-')[0] for path in output.rglob('records/**/*.json')}
    assert names == {f'vot_tir-{name}{ending}' for name in ('steady', 'rough')
                     for ending in ('', '+telemetry', '+dead_pixels')}
    page = (output / 'report.html').read_text(encoding='utf-8')
    assert 'By challenge' in page and 'dead_pixels: dead pixels, rows and columns' in page
    assert '--challenge telemetry --challenge disappear_1s' in page
    again = lmsco(*common, '--challenge', 'dead_pixels')
    assert '2 results are there already, 0 to go' in again.output
    table = tmp_path / 'results.md'
    assert lmsco('results', output, '--page', table).exit_code == 0
    assert '## dead_pixels: dead pixels, rows' in table.read_text(encoding='utf-8')


def test_a_configuration_is_evaluated_beside_its_preset(lmsco, dataset, tmp_path):
    (tmp_path / 'no_scale.yaml').write_text(
        'preset: hcs\nscale: {exponent_min: 0, exponent_max: 0}\n')
    output = tmp_path / 'out'
    result = lmsco('evaluate', dataset, '--output', output, '--sequences', 'ste*', '--frames', 3,
                   '--tracker', f'config:{tmp_path}/no_scale.yaml', '--tracker', 'hcs')
    assert result.exit_code == 0, result.output
    assert {path.parent.name for path in output.rglob('records/**/*.json')} == {'hcs', 'no_scale'}


def test_sequences_and_frames_narrow_the_work_of_a_preset(lmsco, dataset, tmp_path):
    output = tmp_path / 'out'
    result = lmsco('evaluate', dataset, '--tracker', 'hcs', '--output', output,
                   '--sequences', 'ste*', '--frames', 5)
    assert result.exit_code == 0, result.output
    assert [path.parent.name for path in output.rglob('records/**/*.json')] == ['hcs']
    assert 'torn' not in result.output


def test_damage_is_told_and_made_good(lmsco, dataset, scripted, tmp_path):
    output, page = tmp_path / 'out', tmp_path / 'page.md'
    common = ('evaluate', dataset, '--tracker', scripted, '--output', output)
    assert lmsco(*common).exit_code == 0
    (record,) = output.rglob('*steady*.json')
    sound = json.loads(record.read_text(encoding='utf-8'))
    record.write_bytes(b'')
    (output / 'run-ope.json').write_text('{')
    (output / 'run-vot.json').write_text('{')
    told = lmsco('results', output, '--page', page)
    assert told.exit_code == 1 and not page.exists() and 'Traceback' not in told.output
    assert f'{output}/run-ope.json is damaged' in told.output and 'again' in told.output
    again = lmsco(*common)
    assert again.exit_code == 0, again.output
    assert f'{record} is damaged' in again.output and 'it is made again' in again.output
    assert '1 results are there already, 1 to go' in again.output
    assert f'not in the report: {output}/run-vot.json is damaged' in again.output
    assert '--protocol vot' in again.output
    assert json.loads(record.read_text(encoding='utf-8'))['boxes'] == sound['boxes']
    assert lmsco(*common, '--protocol', 'vot').exit_code == 0
    assert lmsco('results', output, '--page', page).exit_code == 0
    assert 'VOT supervised' in page.read_text(encoding='utf-8')


MISTAKES = [
    (('--tracker', 'nobody'), 'there is no tracker'),
    (('--tracker', 'python:math:sqrt'), 'python:math:sqrt cannot be built: TypeError'),
    (('--tracker', 'python:os:getcwd'), 'is no tracker: what it returns has no initialize, up'),
    (('--tracker', 'python:no_such:Module'), 'cannot be imported'),
    (('--tracker', 'python:math:Tracker'), 'cannot be imported'),
    (('--tracker', 'python::'), 'python:: cannot be built'),
    (('--tracker', 'vittrack:{folder}/data/vot_tir/rough/groundtruth.txt'), 'cannot use the mo'),
    (('--sequences', 'stedy'), "matches 'stedy'; near are steady; a pattern is"),
    (('--sequences', '*/nothing'), 'there are vot_tir/rough, vot_tir/steady, vot_tir/torn; a'),
    (('--split', 'benchmarks/thermal_dev.yaml'), 'no sequence of this dataset'),
    (('--every', '10'), 'they go with --protocol anchors'),
    (('--length', '10', '--protocol', 'vot'), 'they go with --protocol anchors'),
    (('--challenge', 'fog'), "there is no challenge 'fog'; known are"),
]


@pytest.mark.parametrize(('words', 'reason'), MISTAKES)
def test_mistakes_are_told_in_one_line(lmsco, dataset, scripted, tmp_path, words, reason):
    trackers = () if '--tracker' in words else ('--tracker', scripted)
    words = [word.format(folder=tmp_path) for word in words]
    result = lmsco('evaluate', dataset, '--output', tmp_path / 'out', *trackers, *words)
    assert result.exit_code == 2, result.output
    assert reason in result.output and 'Traceback' not in result.output
    assert len(result.output.splitlines()) == 1
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize('attribute', ['TrackerCSRT', 'TrackerKCF'])
def test_trackers_of_the_contrib_build_are_missed_in_one_line(
        lmsco, dataset, tmp_path, monkeypatch, attribute):
    monkeypatch.delattr(cv2, attribute, raising=False)
    result = lmsco('evaluate', dataset, '--output', tmp_path / 'out',
                   '--tracker', attribute[len('Tracker'):].lower())
    assert result.exit_code == 2
    assert 'pip install "lmsco_ros[peers]"' in result.output
    assert len(result.output.splitlines()) == 1


def test_a_dataset_that_is_none_is_misuse(lmsco, scripted, tmp_path):
    for dataset, reason in ((tmp_path / 'missing', 'is not a folder'),
                            (tmp_path, 'holds no sequence')):
        result = lmsco('evaluate', dataset, '--tracker', scripted, '--output', tmp_path / 'out')
        assert result.exit_code == 2 and reason in result.output


def test_nothing_left_to_evaluate_is_a_failure(lmsco, dataset, scripted, tmp_path):
    result = lmsco('evaluate', dataset, '--tracker', scripted, '--output', tmp_path / 'out',
                   '--challenge', 'leave')
    assert result.exit_code == 1 and 'no sequence is left to evaluate' in result.output


def test_results_of_nothing_is_an_error(lmsco, tmp_path):
    result = lmsco('results', tmp_path)
    assert result.exit_code == 1
    assert 'no results in' in result.output
