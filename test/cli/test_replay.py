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

"""Folder -> make-bag -> replay -> bag: the answers stand beside the original messages."""

from collections import Counter
import csv
import signal

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.replay.bag_images import RAW
from lmsco_ros.replay.bag_maker import image_message
from lmsco_ros.replay.bags.stamps import header_stamp


def read(path):
    """Return all messages with the types that the bag itself defines: (topic, time, message)."""
    with AnyReader([path]) as reader:
        return [(c.topic, t, reader.deserialize(d, c.msgtype)) for c, t, d in reader.messages()]


def corners(polygon):
    points = np.array([(p.x, p.y) for p in polygon.polygon.points])
    return BoundingBox(*map(float, points.min(0)), *map(float, np.ptp(points, 0)))


@pytest.fixture
def bag(lmsco, tmp_path, scene_folder):
    path = tmp_path / 'bag'
    outcome = lmsco('make-bag', scene_folder, '--output', path)
    assert outcome.exit_code == 0, outcome.output
    return path


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_every_frame_is_answered_at_rate_zero(lmsco, tmp_path, bag, scene, start, storage):
    outcome = lmsco('replay', bag, '--topic', 'image_raw', '--init', start, '--rate', 0,
                    '--storage', storage, '--output', tmp_path / 'out')
    assert outcome.exit_code == 0, outcome.output
    assert '15 of 15 frames answered' in outcome.words
    messages = read(tmp_path / 'out')
    images = [(t, m) for topic, t, m in messages if topic == '/image_raw']
    for (_, message), frame in zip(images, scene):
        assert message.encoding == 'mono16'
        np.testing.assert_array_equal(
            message.data.view(np.uint16).reshape(frame.image.shape), frame.image)
    boxes = {header_stamp(m): (t, corners(m)) for topic, t, m in messages
             if topic == '/lmsco_tracker/box'}
    stamps = [header_stamp(message) for _, message in images]
    assert set(boxes) <= set(stamps) and stamps[0] in boxes
    overlaps = [boxes[s][1].overlap(f.box) for s, f in zip(stamps, scene) if s in boxes]
    assert np.mean(overlaps) > 0.5 and len(overlaps) > 10
    assert all(boxes[s][0] > t for (t, _), s in zip(images, stamps) if s in boxes)
    tracked = {header_stamp(m) for topic, _, m in messages if topic == '/lmsco_tracker/status'}
    assert tracked == set(stamps)


def test_node_and_library_agree(lmsco, tmp_path, bag, start):
    assert lmsco('replay', bag, '--init', start, '--rate', 0,
                 '--output', tmp_path / 'out').exit_code == 0
    assert lmsco('track', bag, '--init', start, '--output', tmp_path / 'run').exit_code == 0
    rows = (tmp_path / 'run' / 'boxes.csv').read_text().splitlines()[1:]
    expected = [[float(v) for v in row.split(',')[2:6]] for row in rows]
    answers = [corners(m).as_tuple() for topic, _, m in read(tmp_path / 'out')
               if topic == '/lmsco_tracker/box']
    np.testing.assert_allclose(answers, expected, atol=0.01)


def test_node_and_library_agree_on_several_targets(lmsco, tmp_path, bag, scene, start):
    """Every target has its id, on ~/boxes and ~/status as in the rows of `lmsco track`."""
    height, width = scene[0].image.shape
    targets = ('--init', start, '--init', f'{0.7 * width},{0.6 * height},20,24')
    outcome = lmsco('replay', bag, *targets, '--rate', 0, '--output', tmp_path / 'out')
    assert outcome.exit_code == 0, outcome.output
    assert '15 of 15 frames answered' in outcome.words
    assert lmsco('track', bag, *targets, '--output', tmp_path / 'run').exit_code == 0
    with (tmp_path / 'run' / 'boxes.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['x']]
    expected = {(int(row['id']), row['stamp']): [
        float(row[name]) for name in ('x', 'y', 'width', 'height')] for row in rows}
    messages, answers = read(tmp_path / 'out'), {}
    for topic, _, message in messages:
        if topic == '/lmsco_tracker/boxes':
            stamp = message.header.stamp
            answers[message.polygon.id, f'{stamp.sec}.{stamp.nanosec:09d}'] = corners(
                message.polygon).as_tuple()
    assert {number for number, _ in answers} == {1, 2} and set(answers) == set(expected)
    for key, box in answers.items():
        np.testing.assert_allclose(box, expected[key], atol=0.01)


def test_more_targets_than_the_node_may_have_are_told(lmsco, tmp_path, bag, start):
    outcome = lmsco('replay', bag, *('--init', start) * 65, '--output', tmp_path / 'out')
    assert outcome.exit_code == 1 and not (tmp_path / 'out').exists()
    assert 'max_targets' in outcome.words and '65' in outcome.words
    assert 'Traceback' not in outcome.output


def test_old_bags_without_type_definitions(lmsco, tmp_path, scene, start):
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / 'old', version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection('/image_raw', RAW, typestore=store)
        chat = writer.add_connection('/chat', 'std_msgs/msg/String', typestore=store)
        for frame in scene[:3]:
            message = image_message(store, frame.image, frame.stamp_ns + 1, 'camera')
            writer.write(connection, frame.stamp_ns, store.serialize_cdr(message, RAW))
        text = store.types['std_msgs/msg/String'](data='hello')
        writer.write(chat, 1, store.serialize_cdr(text, 'std_msgs/msg/String'))
    outcome = lmsco('replay', tmp_path / 'old', '--init', start, '--rate', 0,
                    '--output', tmp_path / 'out')
    assert outcome.exit_code == 0, outcome.output
    messages = read(tmp_path / 'out')
    assert [m.data for topic, _, m in messages if topic == '/chat'] == ['hello']
    assert '/lmsco_tracker/box' in {topic for topic, _, _ in messages}


def test_recorded_rate_and_pictures(lmsco, tmp_path, bag, start):
    outcome = lmsco('replay', bag, '--init', start, '--rate', 2, '--frames', 8, '--images',
                    '--output', tmp_path / 'out')
    assert outcome.exit_code == 0, outcome.output
    counts = Counter(topic for topic, _, _ in read(tmp_path / 'out'))
    assert counts['/image_raw'] == 8
    assert counts['/lmsco_tracker/overlay'] and counts['/lmsco_tracker/confidence_map']


def test_answers_of_an_earlier_replay_are_replaced(lmsco, tmp_path, bag, start):
    first, second = tmp_path / 'first', tmp_path / 'second'
    for source, output in ((bag, first), (first, second)):
        outcome = lmsco('replay', source, '--topic', '/image_raw', '--init', start,
                        '--rate', 0, '--frames', 4, '--output', output)
        assert outcome.exit_code == 0, outcome.output
    boxes = [m for topic, _, m in read(second) if topic == '/lmsco_tracker/box']
    assert len(boxes) == 4


@pytest.mark.parametrize('arguments, code, words', [
    (('--init', '900,10,20,20'), 1, 'the node refuses'),
    (('--init', '10,10,20,20', '--preset', 'nope'), 2, 'nope'),
    (('--init', '10,10,20,20', '--topic', 'nope'), 1, 'it has /image_raw'),
    (('--init', '10,10'), 2, 'four numbers'),
])
def test_errors_leave_no_bag(lmsco, tmp_path, bag, arguments, code, words):
    outcome = lmsco('replay', bag, *arguments, '--output', tmp_path / 'out')
    assert outcome.exit_code == code, outcome.output
    assert words in outcome.words
    assert not (tmp_path / 'out').exists()


def test_existing_output_is_refused_at_once(lmsco, tmp_path, bag, start):
    outcome = lmsco('replay', bag, '--init', start, '--output', bag)
    assert outcome.exit_code == 1 and 'exists' in outcome.words
    assert len(read(bag)) == 15


def test_signal_keeps_what_was_answered_and_says_so(lmsco, lmsco_process, tmp_path, start,
                                                    endless_folder, until_large):
    bag = tmp_path / 'endless'
    assert lmsco('make-bag', endless_folder, '--frames', 2000, '--output', bag).exit_code == 0
    process = lmsco_process('replay', bag, '--init', start, '--rate', 0, '--output',
                            tmp_path / 'out')
    until_large(tmp_path / 'out.partial' / 'out' / 'out.mcap', process)
    process.send_signal(signal.SIGTERM)
    _, complaints = process.communicate(timeout=100)
    assert process.returncode == 128 + signal.SIGTERM and 'Traceback' not in complaints
    counts = Counter(topic for topic, _, _ in read(tmp_path / 'out'))
    assert 50 < counts['/lmsco_tracker/box'] <= counts['/image_raw'] < 2000
    assert (f'kept in {tmp_path / "out"}: the messages so far, with '
            f'{counts["/lmsco_tracker/box"]} boxes of the node') in complaints


@pytest.mark.parametrize('command', [('replay', '--rate', 0), ('track',)])
def test_notes_are_told_once(lmsco, tmp_path, bag, start, command):
    (bag / 'metadata.yaml').unlink()
    outcome = lmsco(*command, bag, '--init', start, '--frames', 3, '--output', tmp_path / 'out')
    assert outcome.exit_code == 0 and '3 ' in outcome.words
    assert outcome.words.count('note: ') == outcome.words.count(f'ros2 bag reindex {bag}') == 1


def test_folder_is_no_bag(lmsco, tmp_path, scene_folder, start):
    outcome = lmsco('replay', scene_folder, '--init', start, '--output', tmp_path / 'out')
    assert outcome.exit_code == 1 and 'metadata.yaml' in outcome.words


@pytest.mark.parametrize('animal', ['hedgehog', 'possum'])
def test_raw_sensor_counts_survive_the_way(lmsco, tmp_path, test_data, animal):
    folder = test_data / 'thermal_dev' / 'lepton_16bit' / animal / 'ir'
    if not folder.is_dir():
        pytest.skip(f'no sequence in {folder}')
    bag, out = tmp_path / 'bag', tmp_path / 'out'
    assert lmsco('make-bag', folder, '--frames', 12, '--output', bag).exit_code == 0
    outcome = lmsco('replay', bag, '--init', '60,50,24,20', '--rate', 0, '--output', out)
    assert outcome.exit_code == 0, outcome.output
    messages = read(out)
    images = [m for topic, _, m in messages if topic == '/image_raw']
    assert len(images) == 12 and {m.encoding for m in images} == {'mono16'}
    assert images[0].data.view(np.uint16).max() > 255
    answered = {header_stamp(m) for topic, _, m in messages if topic == '/lmsco_tracker/status'}
    assert answered == {header_stamp(m) for m in images}
