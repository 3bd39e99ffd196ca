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

"""The folder of a run holds table, film and summary."""

import csv
from dataclasses import replace
import errno
from unittest.mock import Mock

import cv2
from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.results_file import BoxesFile
from lmsco_ros.replay.run_outputs import RunOutputs
from lmsco_ros.visualization.contact_sheet import ContactSheet


def result(state=TrackState.TRACKING):
    box = BoundingBox(20.25, 10, 12, 16)
    return TrackResult(box, 0.8125, state, np.zeros((4, 4), np.float32), box)


def test_rows_are_exact_and_lost_ones_have_no_box(tmp_path):
    with BoxesFile(tmp_path / 'boxes.csv') as file:
        file.add(0, 1_700_000_000_000_000_007, result())
        file.add(1, 1_700_000_000_040_000_007, replace(
            result(TrackState.LOST), note='start: nothing, "really", stands out'))
    with (tmp_path / 'boxes.csv').open() as stream:
        first, second = csv.DictReader(stream)
    assert first == {
        'frame': '0', 'stamp': '1700000000.000000007', 'x': '20.250', 'y': '10.000',
        'width': '12.000', 'height': '16.000', 'score': '0.8125', 'state': 'tracking',
        'id': '1', 'note': ''}
    assert second['note'] == 'start: nothing, "really", stands out'
    assert second['x'] == second['height'] == '' and second['state'] == 'lost'


def test_all_outputs_are_written(tmp_path, frames):
    with RunOutputs(tmp_path / 'a' / 'run', 25, 'a run') as outputs:
        for frame in frames:
            outputs.add(frame, {1: result()}, BoundingBox(20, 10, 12, 16))
    files = {path.name for path in (tmp_path / 'a' / 'run').iterdir()}
    assert files == {'boxes.csv', 'overlay.mp4', 'summary.png'}
    assert len((tmp_path / 'a' / 'run' / 'boxes.csv').read_text().splitlines()) == 11
    film = cv2.VideoCapture(str(tmp_path / 'a' / 'run' / 'overlay.mp4'))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 10


def test_every_target_has_a_row_with_its_id_and_its_box_in_the_film(tmp_path, frames):
    second = BoundingBox(2, 3, 8, 6)
    results = {3: result(), 7: replace(result(TrackState.UNCERTAIN), box=second)}
    for name, told in (('one', {3: result()}), ('two', results)):
        with RunOutputs(tmp_path / name, 25, 'a run') as outputs:
            outputs.add(frames[0], told)
            assert f'boxes.csv with {len(told)} rows' in outputs.kept
    with (tmp_path / 'two' / 'boxes.csv').open() as stream:
        rows = list(csv.DictReader(stream))
    assert [(row['frame'], row['id'], row['x'], row['state']) for row in rows] == [
        ('0', '3', '20.250', 'tracking'), ('0', '7', '2.000', 'uncertain')]
    one, two = (cv2.VideoCapture(str(tmp_path / name / 'overlay.mp4')).read()[1].astype(int)
                for name in ('one', 'two'))
    factor = one.shape[0] / frames[0].image.shape[0]
    left = round(second.x * factor)
    assert np.abs(one - two)[round(5 * factor), left - 2:left + 3].max() > 40


def test_what_was_tracked_before_an_error_is_kept(tmp_path, frames):
    with pytest.raises(RuntimeError):
        with RunOutputs(tmp_path / 'run', 25, 'a run') as outputs:
            outputs.add(frames[0], {1: result()})
            raise RuntimeError
    assert (tmp_path / 'run' / 'summary.png').stat().st_size > 1000


def test_place_that_cannot_be_written_to(tmp_path, frames):
    (tmp_path / 'file').write_text('')
    with pytest.raises(OutputError, match='run: Not a directory; check the place'):
        with RunOutputs(tmp_path / 'file' / 'run', 25, 'a run') as outputs:
            outputs.add(frames[0], {1: result()})


def test_every_row_is_whole_in_the_file_at_once(tmp_path):
    path = tmp_path / 'boxes.csv'
    with BoxesFile(path) as file:
        for index in range(3):
            file.add(index, 0, result())
            assert path.read_bytes().count(b'\n') == index + 2 and path.read_bytes()[-1:] == b'\n'


class FullDisk:
    """A file for which the disk has room for some bytes only, and writes as much as it can."""

    def __init__(self, stream, room):
        self._stream, self._room = stream, room

    def write(self, data):
        if not self._room:
            raise OSError(errno.ENOSPC, 'No space left on device')
        written = self._stream.write(data[:self._room])
        self._room -= written
        return written

    def __getattr__(self, name):
        return getattr(self._stream, name)


@given(room=st.integers(0, 300))
def test_full_disk_leaves_no_half_of_a_row(tmp_path_factory, room):
    path = tmp_path_factory.mktemp('disk') / 'boxes.csv'
    with BoxesFile(path) as file:
        file._stream = FullDisk(file._stream, room)
        with pytest.raises(OSError) as full:
            for index in range(100):
                file.add(index, 0, result())
    assert full.value.filename == str(path)
    heading, *rows = path.read_text().splitlines(keepends=True)
    assert len(rows) == file.rows and all(row.endswith(',tracking,1,\n') for row in rows)
    assert sum(map(len, rows)) <= room


def test_full_disk_names_the_file_that_suffered_first(tmp_path, frames, monkeypatch):
    """The summary finds no room either, which is no news then."""
    outputs = RunOutputs(tmp_path, 25, 'a run')
    full = OSError(errno.ENOSPC, 'No space left on device', str(tmp_path / 'boxes.csv'))
    with pytest.raises(OutputError, match='boxes.csv: No space left on device'):
        with outputs:
            outputs.add(frames[0], {1: result()})
            monkeypatch.setattr(BoxesFile, '_append', Mock(side_effect=full))
            monkeypatch.setattr(ContactSheet, 'save', Mock(side_effect=full))
            outputs.add(frames[1], {1: result()})
    assert outputs.kept == f'kept in {tmp_path}: boxes.csv with 1 rows, overlay.mp4'


def test_summary_that_finds_no_room_is_told_and_leaves_nothing(tmp_path, frames, monkeypatch):
    def save(sheet, path, title):
        path.write_bytes(b'half')
        raise OSError(errno.ENOSPC, 'No space left on device')
    monkeypatch.setattr(ContactSheet, 'save', save)
    with pytest.raises(OutputError, match='summary.png: No space left on device'):
        with RunOutputs(tmp_path, 25, 'a run') as outputs:
            outputs.add(frames[0], {1: result()})
    assert {path.name for path in tmp_path.iterdir()} == {'boxes.csv', 'overlay.mp4'}


def earlier_results(folder):
    folder.mkdir(exist_ok=True)
    for name in ('boxes.csv', 'overlay.mp4', 'summary.png'):
        (folder / name).write_text('earlier')
    (folder / 'notes.txt').write_text('mine')
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_run_without_a_frame_leaves_earlier_results_untouched(tmp_path):
    before = contents(earlier_results(tmp_path))
    with RunOutputs(tmp_path, 25, 'a run') as outputs:
        assert not outputs.kept
    assert outputs.replaced == ()
    assert contents(tmp_path) == before


def test_earlier_results_are_replaced_and_nothing_else(tmp_path, frames):
    earlier_results(tmp_path)
    with RunOutputs(tmp_path, 25, 'a run') as outputs:
        outputs.add_rows(0, 0, {1: result()})
        assert outputs.replaced == ('boxes.csv', 'overlay.mp4', 'summary.png')
        assert set(contents(tmp_path)) == {'boxes.csv', 'notes.txt'}
        outputs.add_picture(frames[0], {1: result()})
    after = contents(tmp_path)
    assert after.pop('notes.txt') == b'mine' and len(after) == 3
    assert b'earlier' not in after.values()
