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

"""`lmsco track`: what it writes, and what it says when it cannot."""

import csv
import os
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState


def rows_of(folder):
    with (folder / 'boxes.csv').open() as stream:
        return list(csv.DictReader(stream))


def box_of(row):
    return BoundingBox(*(float(row[key]) for key in ('x', 'y', 'width', 'height')))


def test_follows_the_target_of_a_folder(lmsco, tmp_path, scene_folder, scene, start):
    outcome = lmsco('track', scene_folder, '--init', start, '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output
    rows = rows_of(tmp_path / 'run')
    assert [int(row['frame']) for row in rows] == list(range(15))
    overlaps = [box_of(row).overlap(f.box) for row, f in zip(rows, scene)]
    assert np.mean(overlaps) > 0.5 and overlaps[0] > 0.99
    film = cv2.VideoCapture(str(tmp_path / 'run' / 'overlay.mp4'))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 15
    assert cv2.imread(str(tmp_path / 'run' / 'summary.png')) is not None


def test_tracker_knows_the_times_of_the_frames(lmsco, tmp_path, scene_folder, start, monkeypatch):
    from lmsco_ros.core import MultiTracker

    times = []
    for name in ('initialize', 'update'):
        def noted(tracker, *given, work=getattr(MultiTracker, name)):
            times.append(given[-1])
            return work(tracker, *given)
        monkeypatch.setattr(MultiTracker, name, noted)
    lmsco('track', scene_folder, '--init', start, '--output', tmp_path / 'run', '--frames', 3)
    assert times == pytest.approx([0.0, 1 / 30, 2 / 30])


def test_ground_truth_starts_and_judges(lmsco, tmp_path, scene_folder, truth):
    outcome = lmsco('track', scene_folder, '--ground-truth', truth, '--frames', 6,
                    '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output
    overlap = re.search(r'mean overlap (0\.\d+) over 6 frames', outcome.output)
    assert overlap and float(overlap[1]) > 0.5
    assert len(rows_of(tmp_path / 'run')) == 6


def test_several_targets_have_a_row_each(lmsco, tmp_path, scene_folder, scene, start):
    """The second one is followed as it is alone."""
    other = '100,80,20,16'
    for name, boxes in (('both', (start, other)), ('alone', (other,))):
        inits = [word for box in boxes for word in ('--init', box)]
        outcome = lmsco('track', scene_folder, *inits, '--output', tmp_path / name)
        assert outcome.exit_code == 0, outcome.output
    rows = rows_of(tmp_path / 'both')
    assert [(int(row['frame']), row['id']) for row in rows] == [
        (frame, number) for frame in range(15) for number in '12']
    overlaps = [box_of(row).overlap(f.box) for row, f in zip(rows[::2], scene)]
    assert np.mean(overlaps) > 0.5
    for row, alone in zip(rows[1::2], rows_of(tmp_path / 'alone'), strict=True):
        # Where it is lost, the first one is not taken for it: another place has that score.
        score = alone['score'] if row['state'] == 'lost' else row['score']
        assert {**row, 'id': '1', 'score': score} == alone


def test_ground_truth_is_that_of_the_first_target(lmsco, tmp_path, scene_folder, start, truth):
    outcome = lmsco('track', scene_folder, '--init', start, '--init', '100,80,20,16',
                    '--ground-truth', truth, '--frames', 3, '--output', tmp_path / 'run')
    overlap = re.search(r'mean overlap (0\.\d+) over 3 frames', outcome.output)
    assert overlap and float(overlap[1]) > 0.5


@pytest.mark.parametrize('rows', [14, 15, 16])
def test_ground_truth_of_another_length_is_told(lmsco, tmp_path, scene_folder, truth, rows):
    lines = truth.read_text().splitlines()
    (tmp_path / 'truth.txt').write_text('\n'.join((lines + lines)[:rows]))
    outcome = lmsco('track', scene_folder, '--ground-truth', tmp_path / 'truth.txt',
                    '--frames', 1, '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output
    assert (f'truth.txt has {rows} rows for 15 frames' in outcome.words) is (rows != 15)


def test_start_is_a_later_frame(lmsco, tmp_path, scene_folder, scene, truth):
    box = ','.join(map(str, scene[6].box.as_tuple()))
    for name, arguments in (('given', ('--init', box)), ('known', ('--ground-truth', truth))):
        outcome = lmsco('track', scene_folder, *arguments, '--start', 6, '--frames', 4,
                        '--output', tmp_path / name)
        assert outcome.exit_code == 0, outcome.output
        rows = rows_of(tmp_path / name)
        assert [int(row['frame']) for row in rows] == [6, 7, 8, 9]
        assert box_of(rows[0]).overlap(scene[6].box) > 0.99
        overlap = np.mean([box_of(row).overlap(scene[int(row['frame'])].box) for row in rows])
        assert overlap > 0.5
    told = re.search(r'mean overlap (0\.\d+) over 4 frames', outcome.output)
    assert told and float(told[1]) == pytest.approx(overlap, abs=0.01)


def test_ground_truth_without_a_target_in_the_first_frame(lmsco, tmp_path, scene_folder, truth):
    lines = truth.read_text().splitlines()
    lines[3] = 'nan,nan,nan,nan'
    (tmp_path / 'truth.txt').write_text('\n'.join(lines))
    outcome = lmsco('track', scene_folder, '--ground-truth', tmp_path / 'truth.txt',
                    '--start', 3, '--output', tmp_path / 'run')
    assert outcome.exit_code == 2 and 'no target in the first frame' in outcome.words


@pytest.fixture
def window(monkeypatch):
    """Return a window in which somebody drags `boxes`, and what it has shown."""
    window = SimpleNamespace(boxes=[], shown=[])
    monkeypatch.setenv('DISPLAY', ':0')
    monkeypatch.setattr(cv2, 'getBuildInformation', lambda: '  GUI:      QT5\n')
    monkeypatch.setattr(cv2, 'destroyAllWindows', lambda: None)
    monkeypatch.setattr(cv2, 'selectROIs', lambda title, image, showCrosshair: (
        window.shown.append(image), np.array(window.boxes).reshape(-1, 4))[1])
    return window


def test_targets_are_dragged_in_a_window(lmsco, tmp_path, scene_folder, scene, window):
    """The image of 128 rows is shown four times as large, in 8 bits."""
    window.boxes = [[round(4 * value) for value in scene[2].box.as_tuple()], [400, 320, 80, 64]]
    outcome = lmsco('track', scene_folder, '--select', '--start', 2, '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output
    shown, = window.shown
    assert shown.shape[:2] == (512, 640) and shown.dtype == np.uint8
    rows = rows_of(tmp_path / 'run')
    assert len(rows) == 26 and rows[0]['frame'] == '2'
    assert box_of(rows[0]).overlap(scene[2].box) > 0.9
    assert box_of(rows[1]) == BoundingBox(100, 80, 20, 16)


def broken_window(*arguments, **options):
    raise cv2.error('cannot open')


@pytest.mark.parametrize('spoil, code, words', [
    (lambda patch: None, 2, 'nothing was selected'),
    (lambda patch: patch.setattr(cv2, 'getBuildInformation', lambda: '  GUI:     NONE\n'), 1,
     'pip install opencv-python; or give --init'),
    (lambda patch: (patch.delenv('DISPLAY'), patch.delenv('WAYLAND_DISPLAY', raising=False)), 1,
     'neither DISPLAY nor WAYLAND_DISPLAY'),
    (lambda patch: patch.setattr(cv2, 'selectROIs', broken_window), 1,
     'no window can be opened')],
    ids=['nothing', 'headless', 'display', 'broken'])
def test_why_nothing_can_be_selected_is_one_line(lmsco, tmp_path, scene_folder, window,
                                                 monkeypatch, spoil, code, words):
    spoil(monkeypatch)
    outcome = lmsco('track', scene_folder, '--select', '--output', tmp_path / 'run')
    assert outcome.exit_code == code and words in outcome.words
    assert len(outcome.output.splitlines()) == 1 and not (tmp_path / 'run').exists()


def test_default_output_is_named_after_the_source(lmsco, tmp_path, scene_folder, start,
                                                  monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert lmsco('track', scene_folder, '--init', start, '--frames', 2).exit_code == 0
    assert (tmp_path / 'output' / 'ir' / 'boxes.csv').exists()


def test_configuration_file(lmsco, tmp_path, scene_folder, start):
    from lmsco_ros.core import TrackerConfig

    (tmp_path / 'mine.yaml').write_text(TrackerConfig.preset('hcs').to_yaml())
    outcome = lmsco('track', scene_folder, '--init', start, '--frames', 2,
                    '--config', tmp_path / 'mine.yaml', '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output


@pytest.mark.parametrize('text, words', [
    ('learning:\n\titerations: 1\n', 'line 2, column 1'),
    ('features: &all [*all]\n', 'levels deep'),
    ('sampling: {newton_steps: many}', "newton_steps is 'many'; expected a int")])
def test_configuration_that_is_none_is_named(lmsco, tmp_path, scene_folder, start, text, words):
    (tmp_path / 'mine.yaml').write_text(text)
    outcome = lmsco('track', scene_folder, '--init', start, '--output', tmp_path / 'run',
                    '--config', tmp_path / 'mine.yaml')
    assert outcome.exit_code == 2 and not (tmp_path / 'run').exists()
    assert words in outcome.words and 'mine.yaml' in outcome.words
    assert len(outcome.output.splitlines()) == 1


@pytest.mark.parametrize('arguments, code, words', [
    (('--init', '1,2,3'), 2, 'four numbers'),
    (('--init', '1,2,nan,4'), 2, 'four numbers'),
    (('--init', ''), 2, 'four numbers'),
    (('--init', '1;2;3;4'), 2, 'four numbers'),
    (('--init', '1e999,0,5,5'), 2, 'four numbers'),
    (('--init', '-300,-300,20,20'), 1, '-300'),
    (('--init', '1e300,1e300,1e300,1e300'), 1, '1e+300'),
    (('--init', '1e-300,0,1e-300,1e-300'), 1, '1e-300'),
    (('--init', '10,10,20,20', '--config', '.'), 2, 'is a directory'),
    (('--init', '1,2,0,4'), 2, 'must be positive'),
    ((), 2, 'no target; give --init'),
    (('--init', '10,10,20,20', '--preset', 'nope'), 2, 'nope'),
    (('--init', '10,10,20,20', '--config', 'missing.yaml'), 2, 'does not exist'),
    (('--init', '10,10,20,20', '--topic', 'image'), 1, 'is not a bag'),
    (('--init', '900,10,20,20'), 1, '900'),
    (('--init', '10,10,20,20', '--init', '900,10,20,20'), 1, '900'),
    (('--init', '10,10,20,20', '--init', '1,2,3'), 2, 'four numbers'),
    (('--init', '10,10,20,20', '--start', '15'), 2, 'no frame 15; the source has 15'),
    (('--init', '10,10,20,20', '--start', '-1'), 2, 'equal to 0'),
    (('--init', '10,10,20,20', '--select'), 2, 'both name the targets'),
    (('--init', '10,10,20,20', '--frames', '0'), 2, 'equal to 1'),
    (('--init', '10,10,20,20', '--frames', '9' * 20), 2, 'equal to 1000000000'),
])
def test_errors_are_one_clear_line(lmsco, tmp_path, scene_folder, arguments, code, words):
    outcome = lmsco('track', scene_folder, '--output', tmp_path / 'run', *arguments)
    assert outcome.exit_code == code, outcome.output
    assert words in outcome.words
    assert 'Traceback' not in outcome.output


def test_earlier_results_are_replaced_and_that_is_told(lmsco, tmp_path, scene_folder, start):
    arguments = ('track', scene_folder, '--init', start, '--output', tmp_path, '--frames')
    assert 'earlier run' not in lmsco(*arguments, 4).words
    outcome = lmsco(*arguments, 2)
    assert outcome.exit_code == 0 and len(rows_of(tmp_path)) == 2
    assert 'in place of those of an earlier run' in outcome.words


@pytest.mark.parametrize('refused', ['box', 'image', 'truth'])
def test_refused_run_leaves_earlier_results_untouched(lmsco, tmp_path, scene_folder, start,
                                                      refused):
    run = tmp_path / 'run'
    assert lmsco('track', scene_folder, '--init', start, '--frames', 3,
                 '--output', run).exit_code == 0
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    broken = tmp_path / 'broken'
    broken.mkdir()
    (broken / '0.png').write_bytes((scene_folder / '00000000.png').read_bytes()[:99])
    (tmp_path / 'truth.txt').write_text('no box\n')
    source, *wanted = {'box': (scene_folder, '--init', '900,900,20,20'),
                       'image': (broken, '--init', start),
                       'truth': (scene_folder, '--ground-truth', tmp_path / 'truth.txt')}[refused]
    outcome = lmsco('track', source, *wanted, '--output', run)
    assert outcome.exit_code == 1 and 'error:' in outcome.words
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_full_disk_is_told_with_what_is_kept(lmsco, tmp_path, endless_folder, start):
    """A file system in memory that is made for this test, where that is allowed."""
    disk = tmp_path / 'disk'
    disk.mkdir()
    if shutil.which('mount') is None or subprocess.run(
            ['mount', '-t', 'tmpfs', '-o', 'size=300k', 'tmpfs', disk],
            capture_output=True).returncode:
        pytest.skip('needs the right to mount')
    try:
        outcome = lmsco('track', endless_folder, '--init', start, '--output', disk / 'run')
        rows = rows_of(disk / 'run')
    finally:
        subprocess.run(['umount', disk], check=True)
    assert outcome.exit_code == 1 and 'Traceback' not in outcome.output
    note, error = outcome.output.splitlines()[-2:]
    assert note.startswith(f'note: kept in {disk / "run"}: boxes.csv with {len(rows)} rows')
    assert re.match(rf'error: {disk}/run/(boxes.csv|overlay.mp4): No space left on device', error)
    assert [int(row['frame']) for row in rows] == list(range(len(rows))) != []


def test_refused_run_makes_no_folder(lmsco, tmp_path, scene_folder):
    lmsco('track', scene_folder, '--init', '900,900,20,20', '--output', tmp_path / 'run')
    assert not (tmp_path / 'run').exists()


def test_images_are_no_place_for_results(lmsco, scene_folder, start):
    """The summary would be an image of the next run."""
    outcome = lmsco('track', scene_folder, '--init', start, '--output', scene_folder)
    assert outcome.exit_code == 2 and 'is the source' in outcome.words


@pytest.mark.parametrize('box, is_told', [
    ('-20,0,100,100', True), ('40,-20,60,80', True), ('100,40,80,40', True), ('0,100,40,60', True),
    ('0,0,160,128', False), ('20.1,60.3,8.7,26.1', False)])
def test_start_box_that_reaches_beyond_the_image_is_told(lmsco, tmp_path, scene_folder, box,
                                                         is_told):
    outcome = lmsco('track', scene_folder, '--init', box, '--frames', 1, '--output', tmp_path)
    assert ('reaches beyond the image of 160 x 128 pixels' in outcome.words) is is_told


def written(folder, images):
    """Return a folder with these images."""
    folder.mkdir()
    for index, image in enumerate(images):
        cv2.imwrite(str(folder / f'{index}.png'), image)
    return folder


def test_start_on_nothing_is_told_once_and_stands_in_its_rows(lmsco, tmp_path, scene, start):
    """The other one, which can be seen, has no note."""
    noise = np.random.default_rng(4).normal(7600, 150, (6, 128, 160)).astype(np.uint16)
    both = [np.hstack([frame.image, seen]) for frame, seen in zip(scene, noise)]
    outcome = lmsco('track', written(tmp_path / 'ir', both), '--init', start,
                    '--init', '230,50,24,30', '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output
    said = [line for line in outcome.output.splitlines() if 'stands out' in line]
    assert said == ['note: frame 0, target 2: start: nothing stands out']
    notes = {number: [row['note'] for row in rows_of(tmp_path / 'run') if row['id'] == number]
             for number in '12'}
    assert notes == {'1': [''] * 6, '2': ['start: nothing stands out'] * 6}


class NotingTracker:
    """A tracker that follows nothing, and notes of each target what it is given for a frame."""

    def __init__(self, box, notes, state=TrackState.UNCERTAIN):
        self._box, self._notes, self._state = box, iter(notes), state
        self.ids, self.results = (), {}

    def initialize(self, image, box, time):
        self.ids = (1,)
        self.update(image, time)

    def update(self, image, time):
        self.results = {
            number: TrackResult(self._box, 0.5, self._state,
                                np.zeros((4, 4), np.float32), self._box, note=note)
            for number, note in next(self._notes).items()}
        return self.results


@pytest.mark.parametrize('notes, told', [
    ([{1: ''}, {1: ''}], []),
    ([{1: ''}, {1: 'hot'}, {1: 'hot'}], ['frame 1, target 1: hot']),
    ([{1: 'hot'}, {1: ''}, {1: 'hot'}], ['frame 0, target 1: hot', 'frame 2, target 1: hot']),
    ([{1: 'hot', 2: 'hot'}, {1: 'cold', 2: 'hot'}],
     ['frame 0, target 1: hot', 'frame 0, target 2: hot', 'frame 1, target 1: cold'])])
def test_what_the_tracker_notes_is_told_when_it_appears(lmsco, tmp_path, scene_folder, scene,
                                                        start, monkeypatch, notes, told):
    monkeypatch.setattr('lmsco_ros.core.MultiTracker',
                        lambda settings: NotingTracker(scene[0].box, notes))
    outcome = lmsco('track', scene_folder, '--init', start, '--frames', len(notes),
                    '--output', tmp_path / 'run')
    assert outcome.exit_code == 0, outcome.output
    assert [line.removeprefix('note: ') for line in outcome.output.splitlines()
            if line.startswith('note: ')] == told


@pytest.mark.parametrize('state, overlap', [
    (TrackState.UNCERTAIN, '1.000'), (TrackState.LOST, '0.000')])
def test_lost_target_overlaps_with_nothing(lmsco, tmp_path, scene_folder, scene, truth,
                                           monkeypatch, state, overlap):
    monkeypatch.setattr('lmsco_ros.core.MultiTracker',
                        lambda settings: NotingTracker(scene[0].box, [{1: ''}], state))
    outcome = lmsco('track', scene_folder, '--ground-truth', truth, '--frames', 1,
                    '--output', tmp_path / 'run')
    assert f'mean overlap {overlap} over 1 frames' in outcome.words


def test_missing_source(lmsco, tmp_path):
    outcome = lmsco('track', tmp_path / 'nothing', '--init', '1,2,3,4')
    assert outcome.exit_code == 2 and 'does not exist' in outcome.words


def test_empty_folder(lmsco, tmp_path):
    outcome = lmsco('track', tmp_path, '--init', '1,2,3,4')
    assert outcome.exit_code == 1 and 'has no images' in outcome.words


def test_broken_video(lmsco, tmp_path):
    (tmp_path / 'film.mp4').write_bytes(b'no film')
    outcome = lmsco('track', tmp_path / 'film.mp4', '--init', '1,2,3,4')
    assert outcome.exit_code == 1 and 'not a readable video' in outcome.words


@pytest.mark.parametrize('kind', ['folder', 'bag'])
def test_recordings_are_tracked_without_ros(lmsco, tmp_path, scene_folder, start, kind):
    source = scene_folder
    if kind == 'bag':
        source = tmp_path / 'bag'
        assert lmsco('make-bag', scene_folder, '--output', source).exit_code == 0
    code = ('import sys\n'
            'missing = ["rclpy", "sensor_msgs", "std_msgs", "geometry_msgs"]\n'
            'sys.modules.update(dict.fromkeys(missing))\n'
            'from lmsco_ros.cli.main import main\n'
            'main()\n')
    ended = subprocess.run(
        [sys.executable, '-c', code, 'track', str(source), '--init', start, '--frames', '3',
         '--output', str(tmp_path / 'run')],
        env=dict(os.environ), capture_output=True, text=True, timeout=100)
    assert ended.returncode == 0, ended.stderr
    assert len(rows_of(tmp_path / 'run')) == 3


def test_stamps_are_those_of_the_film_and_its_damage_is_a_note(lmsco, tmp_path, scene, start):
    times = [index + 10 * (index > 6) for index in range(len(scene))]
    with av.open(str(tmp_path / 'film.mkv'), 'w') as container:
        stream = container.add_stream('ffv1', rate=25)
        stream.height, stream.width = scene[0].image.shape
        stream.pix_fmt = 'gray16le'
        for frame, time in zip(scene, times):
            image = av.VideoFrame.from_ndarray(frame.image, 'gray16le')
            image.pts = time
            container.mux(stream.encode(image))
        container.mux(stream.encode(None))
    content = (tmp_path / 'film.mkv').read_bytes()
    (tmp_path / 'cut.mkv').write_bytes(content[:len(content) * 4 // 5])
    whole, cut = (lmsco('track', tmp_path / name, '--init', start, '--output', tmp_path / name[:3])
                  for name in ('film.mkv', 'cut.mkv'))
    assert whole.exit_code == cut.exit_code == 0, whole.output + cut.output
    assert [float(row['stamp']) for row in rows_of(tmp_path / 'fil')] == [t / 25 for t in times]
    assert 'note:' not in whole.words
    assert 'note: cut.mkv states ' in cut.words
    assert 8 < len(rows_of(tmp_path / 'cut')) < 15
