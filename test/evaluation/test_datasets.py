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

"""Every folder layout is recognized, and broken sequences are named."""

import json

import cv2
import numpy as np
import pytest

from lmsco_ros.evaluation.datasets import scan_dataset
from lmsco_ros.evaluation.datasets.frames import thermal_video
from lmsco_ros.evaluation.errors import DatasetError, SequenceError
from lmsco_ros.media.false_color import without_false_color


def images(folder, count, suffix='.png', color=False):
    """Write `count` images whose level is their index."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        shape = (24, 32, 3) if color else (24, 32)
        cv2.imwrite(str(folder / f'{index + 1:04d}{suffix}'), np.full(shape, index, np.uint8))


def video(path, count):
    """Write a gray video of `count` frames that get brighter."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 25, (32, 24))
    for index in range(count):
        writer.write(np.full((24, 32, 3), 20 * index, np.uint8))
    writer.release()


def text(path, *rows):
    """Write rows of text."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text('\n'.join(rows) + '\n', encoding='utf-8')


def only(root):
    """Return the one sequence below `root`."""
    scan = scan_dataset(root)
    assert not scan.broken
    (sequence,) = scan.sequences
    return sequence


@pytest.mark.parametrize('channel', ['ir', 'color', '.'])
def test_vot_folder_with_polygons_becomes_enclosing_boxes(tmp_path, channel):
    images(tmp_path / 'seq' / channel, 2)
    text(tmp_path / 'seq' / 'groundtruth.txt', '2,9,2,3,6,3,6,9', '1.5,2,3,4')
    sequence = only(tmp_path)
    assert sequence.ground_truth.tolist() == [[2, 3, 4, 6], [1.5, 2, 3, 4]]
    assert sequence.full_name == f'{tmp_path.name}/seq'
    assert [int(sequence.frames[index][0, 0]) for index in range(2)] == [0, 1]


def test_vot_sequence_file_names_the_channel(tmp_path):
    images(tmp_path / 'seq' / 'thermal', 2)
    images(tmp_path / 'seq' / 'color', 3)
    text(tmp_path / 'seq' / 'groundtruth.txt', '1,1,3,3', '1,1,3,3')
    text(tmp_path / 'seq' / 'sequence', 'channels.color=color/%04d.png',
         'channels.ir=thermal/%04d.png', 'channel.default=ir')
    assert len(only(tmp_path).frames) == 2


def test_vot_attributes_are_read_and_empty_is_what_has_none(tmp_path):
    images(tmp_path / 'ir', 3)
    text(tmp_path / 'groundtruth.txt', *['1,1,3,3'] * 3)
    text(tmp_path / 'camera_motion.tag', '1', '0')
    text(tmp_path / 'occlusion.label', '0', '0', '1')
    attributes = only(tmp_path).attributes
    assert attributes['camera_motion'].tolist() == [True, False, False]
    assert attributes['occlusion'].tolist() == [False, False, True]
    assert attributes['empty'].tolist() == [False, True, False]


@pytest.mark.parametrize('row', ['5,6,3,4', '5\t6\t3\t4', '5 6 3 4'])
def test_otb_boxes_start_at_one(tmp_path, row):
    images(tmp_path / 'img', 1, '.jpg')
    text(tmp_path / 'groundtruth_rect.txt', row)
    assert only(tmp_path).ground_truth.tolist() == [[4, 5, 3, 4]]


def test_anti_uav_json_with_frames_and_absent_targets(tmp_path):
    images(tmp_path, 3)
    content = {'exist': [1, 0, 1], 'gt_rect': [[1, 2, 3, 4], [], [0, 0, 0, 0]]}
    text(tmp_path / 'IR_label.json', json.dumps(content))
    truth = only(tmp_path).ground_truth
    assert truth[0].tolist() == [1, 2, 3, 4]
    assert np.isnan(truth[1:]).all()


def test_anti_uav_json_with_video_ignores_the_visible_one(tmp_path):
    video(tmp_path / 'infrared.avi', 3)
    video(tmp_path / 'visible.avi', 5)
    content = {'exist': [1] * 3, 'gt_rect': [[1, 2, 3, 4]] * 3}
    text(tmp_path / 'infrared.json', json.dumps(content))
    assert len(only(tmp_path).frames) == 3


def test_video_and_text_with_nan_rows(tmp_path):
    video(tmp_path / 'video.avi', 4)
    text(tmp_path / 'groundtruth.txt', '1,2,3,4', 'nan,nan,nan,nan', '1,2,3,4', '1,2,0,0')
    sequence = only(tmp_path)
    assert np.isnan(sequence.ground_truth).all(axis=1).tolist() == [False, True, False, True]
    forward = [sequence.frames[index].mean() for index in (0, 2, 3)]
    assert forward == sorted(forward) and forward[0] < forward[2]
    assert sequence.frames[2].mean() == forward[1]
    assert sequence.frames[0].ndim == 2


def test_real_color_stays_and_false_color_goes(tmp_path):
    images(tmp_path / 'ir', 1, color=True)
    text(tmp_path / 'groundtruth.txt', '1,1,3,3')
    assert only(tmp_path).frames[0].shape == (24, 32)
    colored = np.zeros((24, 32, 3), np.uint8)
    colored[..., 2] = 100
    cv2.imwrite(str(tmp_path / 'ir' / '0001.png'), colored)
    assert only(tmp_path).frames[0].shape == (24, 32, 3)


def test_sixteen_bit_images_keep_their_counts(tmp_path):
    (tmp_path / 'ir').mkdir()
    cv2.imwrite(str(tmp_path / 'ir' / '0001.png'), np.full((24, 32), 30_000, np.uint16))
    text(tmp_path / 'groundtruth.txt', '1,1,3,3')
    assert only(tmp_path).frames[0].max() == 30_000


def test_groups_nest_and_broken_sequences_are_reported_with_reason(tmp_path):
    images(tmp_path / 'a' / 'good' / 'ir', 2)
    text(tmp_path / 'a' / 'good' / 'groundtruth.txt', '1,1,3,3', '1,1,3,3')
    images(tmp_path / 'a' / 'short' / 'ir', 2)
    text(tmp_path / 'a' / 'short' / 'groundtruth.txt', '1,1,3,3')
    images(tmp_path / 'b' / 'words' / 'ir', 1)
    text(tmp_path / 'b' / 'words' / 'groundtruth.txt', '1,1,x,3')
    text(tmp_path / 'b' / 'blind' / 'groundtruth.txt', '1,1,3,3')
    images(tmp_path / 'b' / 'untold' / 'ir', 1)
    images(tmp_path / 'b' / 'nothing' / 'ir', 1)
    text(tmp_path / 'b' / 'nothing' / 'groundtruth.txt', 'nan,nan,nan,nan')
    (tmp_path / 'b' / 'garbled').mkdir()
    (tmp_path / 'b' / 'garbled' / 'video.avi').write_bytes(b'no video')
    text(tmp_path / 'b' / 'garbled' / 'groundtruth.txt', '1,1,3,3')
    scan = scan_dataset(tmp_path)
    assert [sequence.full_name for sequence in scan.sequences] == ['a/good']
    reasons = {item.name: item.reason for item in scan.broken}
    assert '2 frames but 1 rows' in reasons['a/short']
    assert 'line 1' in reasons['b/words']
    assert 'without frames' in reasons['b/blind']
    assert 'without ground truth' in reasons['b/untold']
    assert 'no frame has a ground-truth box' in reasons['b/nothing']
    assert 'not a readable video' in reasons['b/garbled']


def reason(root):
    """Return why the one sequence below `root` is broken."""
    scan = scan_dataset(root)
    assert not scan.sequences
    (broken,) = scan.broken
    return broken.reason


@pytest.mark.parametrize(('name', 'content', 'complaint'), [
    ('absence.label', '0 1', 'absence.label has 2 values for 3 frames'),
    ('out_of_view.txt', '0,1,0,0', 'out_of_view.txt has 4 values for 3 frames'),
    ('full_occlusion.txt', '0,2,0', "holds '2'; expected one number from 0 to 1 a frame"),
    ('cover.label', '8 9 1', "cover.label holds '9'; expected one number from 0 to 8"),
    ('occlusion.tag', '0 1 0 0', 'occlusion.tag has 4 values for 3 frames'),
])
def test_files_of_flags_that_do_not_fit_the_frames_are_named(tmp_path, name, content, complaint):
    images(tmp_path, 3)
    text(tmp_path / 'groundtruth.txt', *['1,1,3,3'] * 3)
    text(tmp_path / name, content)
    assert complaint in reason(tmp_path)


def test_visibility_is_read_with_a_byte_order_mark_and_is_no_attribute(tmp_path):
    images(tmp_path, 2)
    text(tmp_path / 'groundtruth.txt', *['1,1,3,3'] * 2)
    text(tmp_path / 'absence.label', '\ufeff0', '1')
    sequence = only(tmp_path)
    assert np.isnan(sequence.ground_truth).all(axis=1).tolist() == [False, True]
    assert not sequence.attributes


@pytest.mark.parametrize(('content', 'complaint'), [
    ('', 'expected an object with the lists'), ('[1, 2]', 'expected an object with the lists'),
    ('{"exist": [1]}', 'expected an object with the lists'),
    ('{"exist": 1, "gt_rect": 2}', 'expected an object with the lists'),
    ('[' * 100_000, 'expected an object with the lists'),
    ('{"exist": [1, 1], "gt_rect": [[1, 2, 3, 4]]}', '2 entries in `exist` but 1 in `gt_rect`'),
    ('{"exist": [1], "gt_rect": [[1, 2, 3]]}', 'entry 0 of `gt_rect` is'),
    ('{"exist": [1], "gt_rect": [["1", 2, 3, 4]]}', 'entry 0 of `gt_rect` is'),
    ('{"exist": [1], "gt_rect": [[1, 2, 3, NaN]]}', 'entry 0 of `gt_rect` is'),
    (f'{{"exist": [1], "gt_rect": [[1, 2, 3, 1{"0" * 400}]]}}', 'entry 0 of `gt_rect` is'),
    ('{"exist": [[]], "gt_rect": [[1, 2, 3, 4]]}', 'entry 0 of `exist` is'),
])
def test_labels_that_are_no_boxes_are_refused(tmp_path, content, complaint):
    images(tmp_path, 1)
    text(tmp_path / 'IR_label.json', content)
    assert 'IR_label.json' in reason(tmp_path) and complaint in reason(tmp_path)


def test_images_of_the_layout_come_before_a_video_beside_them(tmp_path):
    images(tmp_path / 'img', 2)
    video(tmp_path / 'preview.avi', 5)
    images(tmp_path, 1)
    text(tmp_path / 'groundtruth.txt', *['1,1,3,3'] * 2)
    assert len(only(tmp_path).frames) == 2
    for image in (tmp_path / 'img').iterdir():
        image.unlink()
    assert '5 frames but 2 rows' in reason(tmp_path)


def test_of_two_sequences_with_one_name_the_first_is_read(tmp_path):
    for part, box in (('left', '1,1,3,3'), ('right', '2,2,3,3')):
        images(tmp_path / part / 'group' / 'same' / 'ir', 1)
        text(tmp_path / part / 'group' / 'same' / 'groundtruth.txt', box)
    scan = scan_dataset(tmp_path)
    assert [item.ground_truth.tolist() for item in scan.sequences] == [[[1, 1, 3, 3]]]
    assert [item.name for item in scan.broken] == ['group/same']
    assert 'another sequence has this name' in scan.broken[0].reason


def test_a_folder_without_sequences_is_refused(tmp_path):
    with pytest.raises(DatasetError, match='holds no sequence'):
        scan_dataset(tmp_path)
    with pytest.raises(DatasetError, match='not a folder'):
        scan_dataset(tmp_path / 'missing')


def test_fingerprint_follows_frames_truth_and_length(tmp_path):
    images(tmp_path / 'ir', 3)
    text(tmp_path / 'groundtruth.txt', *['1,1,3,3'] * 3)
    original = only(tmp_path)
    assert only(tmp_path).fingerprint == original.fingerprint
    assert len(original.first(2)) == 2
    assert original.first(2).fingerprint != original.fingerprint
    text(tmp_path / 'groundtruth.txt', '1,1,3,3', '1,1,3,3', '1,1,3,4')
    assert only(tmp_path).fingerprint != original.fingerprint


def test_real_sequences_are_all_understood(thermal_dev):
    scan = scan_dataset(thermal_dev)
    groups = {sequence.group for sequence in scan.sequences}
    assert groups == {'anti_uav_ir', 'drone_ir', 'ptb_tir', 'vot_tir'}
    assert {item.name.split('/')[0] for item in scan.broken} <= {'lepton_16bit'}
    assert all(sequence.frames[0].ndim == 2 for sequence in scan.sequences[::20])


def test_real_clips_are_as_opencv_reads_them(thermal_dev):
    clips = [*sorted(thermal_dev.glob('anti_uav_ir/*/*.avi'))[:1],
             *sorted(thermal_dev.glob('drone_ir/*/*.mp4'))[::40]]
    assert clips
    for clip in clips:
        frames, capture = thermal_video(clip.parent), cv2.VideoCapture(str(clip))
        for index in range(len(frames)):
            np.testing.assert_array_equal(frames[index], without_false_color(capture.read()[1]))
        assert not capture.read()[0]


def test_an_image_that_cannot_be_read_makes_the_sequence_a_broken_one(tmp_path):
    images(tmp_path / 'ir', 2)
    (tmp_path / 'ir' / '0002.png').write_bytes(b'no image')
    text(tmp_path / 'groundtruth.txt', '1,1,3,3', '1,1,3,3')
    with pytest.raises(SequenceError, match=r'0002\.png is not a readable image'):
        only(tmp_path).frames[1]


def test_boxes_of_every_tenth_frame_are_continued_and_end_where_the_target_is_absent(tmp_path):
    images(tmp_path / 'clip' / 'ir', 25)
    text(tmp_path / 'clip' / 'ir.txt', '0 0 10 10', '10 20 20 10', '0 0 0 0')
    boxes = only(tmp_path).ground_truth
    np.testing.assert_allclose(boxes[[0, 5, 10]], [
        [0, 0, 10, 10], [5, 10, 15, 10], [10, 20, 20, 10]])
    assert np.isfinite(boxes[:11]).all() and np.isnan(boxes[11:]).all()


def test_a_last_box_of_every_tenth_frame_holds_to_the_end(tmp_path):
    images(tmp_path / 'clip' / 'ir', 15)
    text(tmp_path / 'clip' / 'ir.txt', '0 0 10 10', '10 20 20 10')
    np.testing.assert_array_equal(only(tmp_path).ground_truth[10:], [[10, 20, 20, 10]] * 5)


def test_rows_of_every_frame_and_too_few_are_told_from_every_tenth(tmp_path):
    images(tmp_path / 'clip' / 'ir', 11)
    text(tmp_path / 'clip' / 'ir.txt', *['0 0 10 10'] * 11)
    assert len(only(tmp_path)) == 11
    text(tmp_path / 'clip' / 'ir.txt', *['0 0 10 10'] * 3)
    assert '11 frames but 3 rows of ground truth' in reason(tmp_path)


def test_one_truth_of_both_channels_comes_before_that_of_the_infrared_one(tmp_path):
    images(tmp_path / 'clip' / 'ir', 1)
    text(tmp_path / 'clip' / 'ir.txt', '0 0 10 10')
    text(tmp_path / 'clip' / 'groundtruth.txt', '5 5 10 10')
    assert only(tmp_path).ground_truth.tolist() == [[5, 5, 10, 10]]


def test_boxes_of_the_visible_channel_stand_beside_those_of_the_infrared_one(tmp_path):
    images(tmp_path / 'clip' / 'i', 2)
    text(tmp_path / 'clip' / 'groundTruth_i.txt', '0 0 10 10', '15 25 5 5')
    text(tmp_path / 'clip' / 'groundTruth_v.txt', '1 0 11 10', '6 5 16 25')
    sequence = only(tmp_path)
    assert sequence.ground_truth.tolist() == [[0, 0, 10, 10], [5, 5, 10, 20]]
    assert sequence.other_truth.tolist() == [[1, 0, 10, 10], [6, 5, 10, 20]]
    assert sequence.first(1).other_truth.tolist() == [[1, 0, 10, 10]]
    text(tmp_path / 'clip' / 'groundTruth_v.txt', '1 0 11 10')
    assert '2 frames but 1 rows' in reason(tmp_path)
