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

"""A recording in the page: played, stepped through in both directions, marked, and written."""

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from starlette.testclient import TestClient

from lmsco_ros.console import recording as recordings
from lmsco_ros.console.access import Access
from lmsco_ros.console.annotate import annotating
from lmsco_ros.console.marks import Marks
from lmsco_ros.console.recording import Annotator, Recording
from lmsco_ros.console.requests import RequestError
from lmsco_ros.console.settings import ConsoleSettings
from lmsco_ros.console.web import make_app
from lmsco_ros.evaluation.datasets.boxes_text import read_boxes
from lmsco_ros.replay.bags.output import BagOutput
from lmsco_ros.replay.errors import OutputError, SourceError
from lmsco_ros.replay.sources import open_source
from lmsco_ros.replay.storage import Storage
from msg_adapters.boxes import Box

FRAMES = 12
OWN = {'origin': 'http://127.0.0.1:8080', 'host': '127.0.0.1:8080'}


@pytest.fixture
def folder(tmp_path):
    """Return a folder of images whose values tell their numbers."""
    folder = tmp_path / 'frames'
    folder.mkdir()
    for number in range(FRAMES):
        cv2.imwrite(str(folder / f'{number:03}.png'), np.full((48, 64), 100 + number, np.uint16))
    return folder


@pytest.fixture
def marks(tmp_path):
    return Marks(tmp_path / 'marks.txt', FRAMES)


def rows(tmp_path):
    return (tmp_path / 'marks.txt').read_text().splitlines()


def test_boxes_between_marks_are_interpolated(marks, tmp_path):
    marks.set(2, Box(10, 20, 8, 6))
    marks.set(6, Box(18, 20, 8, 10))
    assert marks.at(4) == ('interpolated', Box(14, 20, 8, 8)) and marks.at(2)[0] == 'marked'
    assert marks.at(1) == ('unmarked', None) == marks.at(7)
    marks.set(8, None)
    assert marks.at(7) == ('unmarked', None) and marks.at(11) == ('absent', None)
    marks.set(10, Box(1, 1, 2, 2))
    assert marks.at(9) == ('absent', None)
    assert len(rows(tmp_path)) == FRAMES and rows(tmp_path)[4] == '14.00,20.00,8.00,8.00'
    assert rows(tmp_path)[9] == rows(tmp_path)[0] == 'nan,nan,nan,nan'
    marks.remove(6)
    assert marks.at(4) == ('unmarked', None) and rows(tmp_path)[4] == 'nan,nan,nan,nan'


def test_marks_are_read_as_ground_truth(marks, tmp_path):
    marks.set(0, Box(10.25, 20, 8, 6))
    marks.set(2, Box(12.25, 20, 8, 6))
    boxes = np.array(read_boxes(tmp_path / 'marks.txt'), float)
    assert boxes.shape == (FRAMES, 4) and boxes[1].tolist() == [11.25, 20, 8, 6]
    assert np.isnan(boxes[3:]).all()


def test_mark_that_cannot_be_written_is_not_kept(tmp_path):
    (tmp_path / 'plain').touch()
    marks = Marks(tmp_path / 'plain' / 'marks.txt', FRAMES)
    with pytest.raises(OSError):
        marks.set(2, Box(1, 2, 3, 4))
    assert not len(marks)


def test_marks_are_written_as_polygons(marks, tmp_path):
    marks.set(2, Box(10, 20, 8, 6))
    marks.set(4, Box(12, 20, 8, 6))
    bag = BagOutput(tmp_path / 'bag', Storage.MCAP)
    assert marks.write_bag(bag, {number: 10 ** 9 + number for number in range(4)}) == 2
    with AnyReader([tmp_path / 'bag']) as reader:
        found = [(logged, reader.deserialize(data, connection.msgtype))
                 for connection, logged, data in reader.messages()]
    assert [logged for logged, _ in found] == [10 ** 9 + 2, 10 ** 9 + 3]
    corners = [(point.x, point.y) for point in found[1][1].polygon.points]
    assert corners == [(11, 20), (19, 20), (19, 26), (11, 26)]
    assert found[0][1].header.stamp.nanosec == 2


@pytest.mark.parametrize('room', [10 ** 9, 3 * 48 * 64 * 2])
def test_frames_are_had_in_any_order(folder, monkeypatch, room):
    monkeypatch.setattr(recordings, '_MOST_BYTES', room)
    recording = Recording(open_source(folder))
    for index in (0, 5, 4, 11, 2, 10, 0, 1):
        frame = recording.at(index)
        assert frame.index == index and frame.image[0, 0] == 100 + index
    assert recording.at(99).index == FRAMES - 1 and recording.at(-5).index == 0
    assert recording._bytes <= max(room, 48 * 64 * 2)


def test_recording_that_is_shorter_than_it_states(folder):
    class Source:
        def __len__(self):
            return FRAMES + 5

        def __iter__(self):
            return iter(open_source(folder))

    recording = Recording(Source())
    assert recording.at(FRAMES + 3).index == FRAMES - 1 and len(recording) == FRAMES


def test_stamp_of_no_frame_is_refused(folder, marks):
    annotator = Annotator(Recording(open_source(folder)), marks)
    with pytest.raises(RequestError, match='no frame'):
        annotator.start(77, (1, 2, 3, 4))


@pytest.fixture
def page(folder, marks, make_desk):
    """Return a greeted page over the recording."""
    annotator = Annotator(Recording(open_source(folder)), marks)
    desk = make_desk(marker=annotator, length=FRAMES)
    desk = recordings_desk(desk, annotator)
    browser = TestClient(make_app(desk, Access()), base_url='http://127.0.0.1:8080')
    with browser.websocket_connect('/socket', headers=OWN) as socket:
        hello = socket.receive_json()
        assert hello['is_recording'] and hello['length'] == FRAMES
        yield socket


def recordings_desk(desk, annotator):
    from dataclasses import replace
    return replace(desk, operator=annotator,
                   open_frames=lambda: recordings.RecordedFrames(annotator))


def step(page, read_frame, number, by=0):
    page.send_json({'type': 'step', 'number': number, 'by': by})
    return read_frame(page.receive_bytes())[0]


def test_a_person_steps_and_marks(page, read_frame, tmp_path):
    state = step(page, read_frame, 1, 3)
    assert (state['number'], state['state'], state['targets']) == (4, 'unmarked', [])
    page.send_json({'type': 'start', 'stamp': state['stamp'], 'box': [10, 20, 8, 6]})
    state = step(page, read_frame, 4)
    assert state['state'] == 'marked' and state['targets'][0]['box'] == [10, 20, 8, 6]
    last = step(page, read_frame, 4, 2)
    page.send_json({'type': 'start', 'stamp': last['stamp'], 'box': [14, 20, 8, 6]})
    assert step(page, read_frame, 5)['targets'][0]['box'] == [12, 20, 8, 6]
    page.send_json({'type': 'absent', 'stamp': last['stamp']})
    assert step(page, read_frame, 6)['state'] == 'absent'
    page.send_json({'type': 'unmark', 'stamp': last['stamp']})
    assert step(page, read_frame, 6)['state'] == 'unmarked'
    assert [row != 'nan,nan,nan,nan' for row in rows(tmp_path)] == [
        number == 3 for number in range(FRAMES)]


def test_it_plays_every_frame_to_the_end(page, read_frame, monkeypatch):
    monkeypatch.setattr(recordings, '_END_SECONDS', 0.01)
    numbers = []
    while True:
        page.send_json({'type': 'next', 'drawn': 0})
        message = page.receive()
        if message.get('text'):
            break
        numbers.append(read_frame(message['bytes'])[0]['number'])
    assert numbers == list(range(1, FRAMES + 1)) and '"silence"' in message['text']


def test_what_only_a_tracker_can_do_is_refused(page):
    for message in ({'type': 'reset'}, {'type': 'enable', 'on': True},
                    {'type': 'point', 'stamp': '0', 'x': 1, 'y': 1}):
        page.send_json(message)
        assert page.receive_json()['done'] is False


def test_damaged_recording_is_told_and_can_be_tried_again(
        folder, marks, make_desk, read_frame):
    recording = Recording(open_source(folder))

    def damaged():
        raise SourceError('damaged')
        yield

    recording._rest = damaged()
    annotator = Annotator(recording, marks)
    desk = recordings_desk(make_desk(marker=annotator), annotator)
    browser = TestClient(make_app(desk, Access()), base_url='http://127.0.0.1:8080')
    with browser.websocket_connect('/socket', headers=OWN) as page:
        page.receive_json()
        page.send_json({'type': 'next', 'drawn': 0})
        assert page.receive_json()['text'] == 'damaged'
        assert page.receive_json()['type'] == 'silence'
        assert step(page, read_frame, 1, 3)['number'] == 4


def test_live_pages_cannot_mark(make_desk):
    browser = TestClient(make_app(make_desk(), Access()), base_url='http://127.0.0.1:8080')
    with browser.websocket_connect('/socket', headers=OWN) as socket:
        socket.receive_json()
        socket.send_json({'type': 'absent', 'stamp': '5'})
        assert 'recording' in socket.receive_json()['text']


def test_file_of_marks_is_not_overwritten(folder, tmp_path):
    (tmp_path / 'marks.txt').write_text('1,2,3,4\n')
    with pytest.raises(OutputError, match='there already'), annotating(
            folder, tmp_path / 'marks.txt', ConsoleSettings(port=0)):
        pass
    assert (tmp_path / 'marks.txt').read_text() == '1,2,3,4\n'
