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

"""`lmsco make-bag`: options reach the bag."""

import signal

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

PATIENCE_SECONDS = 100.0


def connections_of(path):
    with AnyReader([path]) as reader:
        messages = [(t, reader.deserialize(d, c.msgtype)) for c, t, d in reader.messages()]
        return list(reader.connections), messages


def test_options_reach_the_bag(lmsco, tmp_path, scene_folder):
    outcome = lmsco('make-bag', scene_folder, '--output', tmp_path / 'bag', '--storage',
                    'sqlite3', '--fps', 10, '--topic', '/a/image', '--frame-id', 'here',
                    '--frames', 4)
    assert outcome.exit_code == 0 and '4 frames on /a/image' in outcome.words
    (connection,), messages = connections_of(tmp_path / 'bag')
    assert connection.topic == '/a/image'
    assert np.diff([t for t, _ in messages]).tolist() == [100_000_000] * 3
    assert messages[0][1].header.frame_id == 'here'
    assert next((tmp_path / 'bag').glob('*.db3'))


def test_gray_video_becomes_mono8(lmsco, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / 'film.avi'), cv2.VideoWriter.fourcc(*'MJPG'), 20,
                             (64, 48))
    for index in range(5):
        writer.write(np.full((48, 64, 3), 50 * index, np.uint8))
    writer.release()
    outcome = lmsco('make-bag', tmp_path / 'film.avi', '--output', tmp_path / 'bag')
    assert outcome.exit_code == 0, outcome.output
    _, messages = connections_of(tmp_path / 'bag')
    assert [m.encoding for _, m in messages] == ['mono8'] * 5
    assert np.diff([t for t, _ in messages]).tolist() == [50_000_000] * 4
    assert next((tmp_path / 'bag').glob('*.mcap'))


def test_a_bag_is_no_source(lmsco, tmp_path, scene_folder):
    assert lmsco('make-bag', scene_folder, '--output', tmp_path / 'bag').exit_code == 0
    outcome = lmsco('make-bag', tmp_path / 'bag', '--output', tmp_path / 'other')
    assert outcome.exit_code == 2 and 'is a bag already' in outcome.words


def test_existing_output_is_refused(lmsco, tmp_path, scene_folder):
    (tmp_path / 'bag').mkdir()
    outcome = lmsco('make-bag', scene_folder, '--output', tmp_path / 'bag')
    assert outcome.exit_code == 1 and 'exists' in outcome.words


@pytest.fixture
def writing(lmsco_process, tmp_path, endless_folder, until_large):
    """Return a process that has written some megabytes of a bag, and will for long."""
    process = lmsco_process('make-bag', endless_folder, '--output', tmp_path / 'bag')
    until_large(tmp_path / 'bag.partial' / 'bag' / 'bag.mcap', process)
    assert not (tmp_path / 'bag').exists()
    return process


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP],
                         ids=lambda number: number.name)
def test_signal_keeps_what_was_written_and_says_so(writing, tmp_path, number):
    writing.send_signal(number)
    _, complaints = writing.communicate(timeout=PATIENCE_SECONDS)
    assert writing.returncode == 128 + number and 'Traceback' not in complaints
    _, messages = connections_of(tmp_path / 'bag')
    assert len(messages) > 50
    assert (f'note: kept in {tmp_path / "bag"}: a bag with {len(messages)} frames'
            in complaints.splitlines())
    assert [path.name for path in tmp_path.iterdir()] == ['bag']


def test_killed_process_leaves_nothing_that_looks_whole(writing, lmsco, tmp_path, scene_folder):
    writing.kill()
    writing.wait(PATIENCE_SECONDS)
    assert [path.name for path in tmp_path.iterdir()] == ['bag.partial']
    outcome = lmsco('make-bag', scene_folder, '--output', tmp_path / 'bag')
    assert outcome.exit_code == 1 and 'one that was killed left it' in outcome.words


def test_refused_source_leaves_no_bag(lmsco, tmp_path):
    (tmp_path / 'empty').mkdir()
    outcome = lmsco('make-bag', tmp_path / 'empty', '--output', tmp_path / 'bag')
    assert outcome.exit_code == 1 and 'has no images' in outcome.words
    assert [path.name for path in tmp_path.iterdir()] == ['empty']
