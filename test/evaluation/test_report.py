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

"""The page is whole, self-contained, and holds everything that was run."""

from dataclasses import replace
from html.parser import HTMLParser
import re

import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.protocols.bootstrap import Estimate
from lmsco_ros.evaluation.report.conditions import command_line
from lmsco_ros.evaluation.report.failures import worst_failures
from lmsco_ros.evaluation.report.formatting import interval, number, signed, spread_warning
from lmsco_ros.evaluation.report.page import write_report
from lmsco_ros.evaluation.report.pictures import encode, failure_strip, thumbnail
from lmsco_ros.evaluation.results_page import results_page
from lmsco_ros.evaluation.run_file import EvaluationRun, read_run, SequenceInfo, write_run
from lmsco_ros.evaluation.split import Split
from lmsco_ros.evaluation.summaries.score import size_note
from lmsco_ros.evaluation.trace import Trace
from lmsco_ros.evaluation.whole_file import write_json
from lmsco_ros.media.colors import bgr, TRUTH_COLOR

VOID = {'meta', 'img', 'rect', 'line', 'br', 'link'}
TRACKERS = ('hcs', 'csrt', 'lazy')


class Page(HTMLParser):
    """Collects text and references, and checks that tags are closed in order."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.references, self.images = [], [], [], 0

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.references += [values[key] for key in ('src', 'href', 'data') if key in values]
        self.images += tag == 'img'
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def answers(truth, tracker, protocol):
    """Return what a tracker does: follow, follow with a lag, or not move at all."""
    frames = len(truth)
    boxes = truth.copy()
    if tracker == 'csrt':
        boxes[1:] = truth[:-1]
    lazy = tracker == 'lazy'
    if lazy:
        boxes[:] = truth[0]
    supervised = protocol == 'vot' and lazy
    return Trace(boxes, np.linspace(1, .5, frames), np.arange(frames) > frames - 3 if lazy
                 else np.zeros(frames, bool), starts=(0, 17) if supervised else (0,),
                 failures=(12,) if supervised else (), updates=frames - 1, cpu_seconds=.5,
                 wall_seconds=.6, error='frame 9: stumbled' if lazy else None)


@pytest.fixture
def sequences(tmp_path, vot_folder):
    """Return two sequences with attributes, in two groups."""
    for group, name in (('vot_tir', 'birds'), ('drone_ir', 'a<b>&c')):
        folder = vot_folder(tmp_path / 'data' / group / name, [0] * 24)
        (folder / 'camera_motion.tag').write_text('1\n' * 12, encoding='utf-8')
    return scan_dataset(tmp_path / 'data').sequences


@pytest.fixture
def runs(sequences):
    """Return a run under each protocol."""
    infos = tuple(SequenceInfo(item.name, item.group, (64, 48), item.ground_truth,
                               item.attributes) for item in sequences)
    context = {'dataset': 'thermal', 'split': 'thermal.yaml', 'part': 'test', 'jobs': 2,
               'date': '2026-01-01',
               'machine': {'processor': 'Abacus 3000', 'cores': '2'},
               'versions': {'numpy': '9.9'},
               'skipped': [{'name': 'x/broken', 'reason': 'no frames'}]}
    return {protocol: EvaluationRun(
        protocol, infos,
        {name: tuple(answers(info.ground_truth, name, protocol) for info in infos)
         for name in TRACKERS}, context) for protocol in ('ope', 'vot')}


@pytest.fixture
def parse(tmp_path, sequences):
    """Return a function that writes the report of runs and parses it."""
    def write(runs):
        path = write_report(tmp_path, runs, {item.full_name: item for item in sequences})
        page = Page()
        page.feed(path.read_text(encoding='utf-8'))
        assert page.open == []
        return page
    return write


def test_page_holds_everything_and_refers_to_nothing_outside(parse, runs, tmp_path):
    page = parse(runs)
    text = ' '.join(page.text)
    for name in (*TRACKERS, 'birds', 'a<b>&c', 'camera motion', 'Abacus 3000', '2026-01-01'):
        assert name in text
    assert 'skipped x/broken: no frames' in text
    assert 'lazy crashed on vot_tir/birds: frame 9: stumbled' in text
    assert all(reference.startswith(('data:image/', '#')) for reference in page.references)
    # Nine plots, two thumbnails, and the strips of the tracker that never moved.
    assert page.images == 9 + 2 + 2
    names = {path.stem for path in (tmp_path / 'pictures').glob('*.png')}
    assert {'success', 'precision', 'normalized_precision', 'speed', 'ar_raw', 'ar_rank',
            'reliability', 'eao_curve', 'eao_order', 'failure_lazy_vot_tir_birds'} <= names


def test_page_of_several_starts_alone(parse, runs):
    page = parse({'anchors': replace(runs['ope'], protocol='anchors')})
    # A plot, two thumbnails, and the strips of the tracker that never moved.
    assert page.images == 1 + 2 + 2
    assert '#anchors' in page.references
    assert 'Success AUC (sequence@first-last frame) of each tracker on each sequence.' in page.text


@pytest.mark.parametrize('protocol', ['ope', 'vot'])
def test_page_of_one_protocol_alone(parse, runs, protocol):
    page = parse({protocol: runs[protocol]})
    assert page.images == 4 + (protocol == 'ope') + 2 + 2
    anchors = [item for item in page.references if item.startswith('#')]
    assert ('#one-pass' in anchors) == (protocol == 'ope')


@pytest.mark.parametrize('protocol, note, counted', [
    ('ope', 'below it the number of frames. They are annotated.', ['24', '24']),
    ('vot', 'below it the failures. They are annotated.', ['0', '2'])])
def test_attributes_are_told_with_what_is_counted(
        tmp_path, sequences, runs, protocol, note, counted):
    """Each sequence fails once, in the first frame without camera motion."""
    path = write_report(tmp_path, {protocol: runs[protocol]},
                        {item.full_name: item for item in sequences})
    table = path.read_text(encoding='utf-8').split(note)[1].split('</table>')[0]
    row = next(row for row in table.split('</tr>') if 'lazy' in row)
    assert re.findall(r'class="range">(.*?)<', row) == counted


def test_only_the_tracker_that_fails_is_shown_failing(runs):
    found = worst_failures(runs['ope'])
    assert {item.tracker for item in found} == {'lazy'}
    # Ten pixels wide and one pixel a frame: overlap falls below a tenth at frame 9.
    assert found[0].frames == (0, 4, 9, 14, 23)


def test_pictures_mark_truth_and_answer(sequences):
    truth = sequences[0].ground_truth
    strip = failure_strip(sequences[0].frames, truth, truth + (6, 6, 0, 0), (2, 5), '#ff0000')
    assert strip.shape == (160, 2 * 210 + 4, 3)
    levels = strip.astype(int)
    true = np.abs(levels - bgr(TRUTH_COLOR)).max(axis=-1) < 12
    red = (levels[..., 2] > 150) & (levels[..., 1] < 80)
    assert true.sum() > 40 and red.sum() > 40
    assert thumbnail(sequences[0]).shape == (100, 132, 3)
    assert encode(strip, '.png')[1:4] == b'PNG'


def test_command_can_be_repeated(runs):
    assert command_line(runs['vot']) == (
        'lmsco evaluate thermal --protocol vot --split thermal.yaml --part test --tracker hcs '
        '--tracker csrt --tracker lazy --jobs 2 --output results')


def test_results_page_has_a_table_for_each_kind_of_scene(tmp_path, runs):
    for protocol, run in runs.items():
        for name, traces in run.traces.items():
            for info, trace in zip(run.sequences, traces):
                write_json(tmp_path / f'{protocol}-{name}-{info.group}.json', trace.to_json())
        write_run(tmp_path, protocol, run.sequences,
                  {name: [f'{protocol}-{name}-{info.group}.json' for info in run.sequences]
                   for name in TRACKERS}, run.context)
    names = frozenset(item.full_name for item in run.sequences)
    split = Split('thermal', {'test': names}, {'ground-level': ('vot_tir', 'ptb_tir'),
                                               'aerial': ('anti_uav_ir', 'drone_ir')},
                  'Few sequences.\n')
    text = results_page([tmp_path], split)
    titles = [line for line in text.splitlines() if line.startswith('## ')]
    assert titles == ['## Ground-level (vot_tir, ptb_tir)', '## Aerial (anti_uav_ir, drone_ir)',
                      '## All sequences', '## Conditions']
    assert '\nFew sequences.\n' in text
    plain = results_page([tmp_path])
    assert [line for line in plain.splitlines() if line.startswith('## ')] == [
        '## All sequences', '## Conditions']
    assert '| csrt | ' in text and 'Abacus 3000' in text
    assert text.count('| tracker | camera motion | empty |') == 3
    assert str(tmp_path) not in text
    again = read_run(tmp_path, 'vot')
    assert again.traces['lazy'][0].failures == (12,)
    assert np.allclose(again.traces['csrt'][1].boxes, runs['vot'].traces['csrt'][1].boxes)


@pytest.mark.parametrize('named, told', [(True, True), (False, False)])
def test_what_a_split_says_is_said_of_its_sequences_only(tmp_path, runs, named, told):
    run = runs['ope']
    for name, traces in run.traces.items():
        for info, trace in zip(run.sequences, traces):
            write_json(tmp_path / f'{name}-{info.group}.json', trace.to_json())
    write_run(tmp_path, 'ope', run.sequences, {
        name: [f'{name}-{info.group}.json' for info in run.sequences] for name in TRACKERS},
        run.context)
    names = {item.full_name for item in run.sequences} if named else {'vot_tir/elsewhere'}
    split = Split('mine', {'test': frozenset(names)}, {}, 'Picked as hard ones.\n')
    assert ('Picked as hard ones.' in results_page([tmp_path], split)) is told


def test_auroc_compares_sizes_where_all_frames_are_near(parse, runs):
    run = runs['ope']
    near = 'All frames of hcs'
    truths = [info.ground_truth for info in run.sequences]
    for distance, told in ((5, True), (5.1, False)):
        traces = tuple(replace(trace, boxes=truth + (distance, 0, 0, 0))
                       for trace, truth in zip(run.traces['hcs'], truths))
        changed = replace(run, traces={**run.traces, 'hcs': traces})
        assert (near in size_note(changed)) is told
        assert any(near in text for text in parse({'ope': changed}).text) is told


def test_absences_have_a_table_only_where_there_are_any(parse, runs):
    assert 'targets that left' not in parse(runs).text
    infos = []
    for info, challenge in zip(runs['ope'].sequences, ('leave', 'twin')):
        truth = info.ground_truth.copy()
        truth[8:12] = np.nan if challenge == 'leave' else truth[8:12]
        infos.append(SequenceInfo(info.name, info.group, info.size, truth, info.attributes,
                                  challenge))
    run = runs['ope']
    page = parse({'ope': EvaluationRun('ope', tuple(infos), run.traces, run.context)})
    assert page.text.count('targets that left') == 1
    assert page.text.count('AUROC of the score') == 2
    assert 'leave: the picture pans away from the target and back' in page.text


def test_covariances_have_tables_by_kind_of_scene_where_a_tracker_tells_them(parse, runs):
    assert 'Covariance' not in parse(runs).text
    run = runs['ope']
    told = tuple(replace(trace, predicted=trace.boxes,
                         covariances=np.tile(np.eye(4), (len(trace.boxes), 1, 1)))
                 for trace in run.traces['lazy'])
    run = replace(run, traces={**run.traces, 'lazy': told})
    by_group = parse({'ope': run}).text
    assert by_group.count('within the 95 % ellipse') == 2 * 3
    assert {'vot_tir', 'drone_ir', 'all sequences'} <= set(by_group)
    scenes = {'aerial': ['drone_ir'], 'ground-level': ['vot_tir', 'ptb_tir'], 'sea': ['none']}
    run = replace(run, context={**run.context, 'scenes': scenes})
    by_scene = parse({'ope': run}).text
    assert {'aerial (drone_ir)', 'ground-level (vot_tir, ptb_tir)'} <= set(by_scene)
    assert 'sea (none)' not in by_scene and by_scene.count('within the 95 % ellipse') == 2 * 3


def test_starts_on_nothing_have_no_accuracy_and_are_told_apart(parse, runs):
    infos = []
    for info in runs['ope'].sequences:
        truth = np.full((40, 4), np.nan)
        truth[0] = info.ground_truth[0]
        infos.append(SequenceInfo(info.name, info.group, info.size, truth, {},
                                  'start_on_background'))
    traces = {name: tuple(Trace(np.tile(info.ground_truth[0], (40, 1)), np.full(40, 0.9),
                                np.zeros(40, bool), (0,), updates=39) for info in infos)
              for name in TRACKERS}
    page = parse({'ope': EvaluationRun('ope', tuple(infos), traces, {})})
    assert 'starts on nothing' in page.text and 'nan' not in ' '.join(page.text)


def test_pictures_show_images_with_pixels_without_a_value():
    image = np.tile(np.linspace(7000, 7600, 64, dtype=np.float32), (48, 1))
    image[4:8, 4:8] = np.nan
    image[40:44] = np.inf
    box = np.array([[20., 10, 20, 20]])
    strip = failure_strip([image], box, box, [0], '#ff0000')
    assert strip.std() > 20


def test_figures_as_text():
    assert number(.5) == '.500' and number(float('nan')) == '–' and number(12.345, 1) == '12.3'
    assert number(-.25) == '−.250'
    assert interval(Estimate(.5, .4, .6)) == '.400 – .600'
    assert interval(Estimate(.5, float('nan'), float('nan'))) == ''
    assert signed(Estimate(.1, .05, .2)) == '+.100'
    assert 'fewer than 6 sequences' in spread_warning(5) and not spread_warning(6)
