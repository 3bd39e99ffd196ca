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

"""Sequences become one recording, which goes through the node and comes back as figures."""

import numpy as np
import pytest

from benchmarks.field_answers import Answers, in_parts, read_answers, write_answers
from benchmarks.field_bag import event_table, part_table, play, SIZE, write_bag
from benchmarks.field_sheet import chosen_moments, draw_sheet
from benchmarks.joined_recording import Fit, join, read_truth, stamp_of, write_truth
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.run_file import SequenceInfo
from lmsco_ros.replay.bag_images import BagImages
from lmsco_ros.synthetic import render_scene, SceneConfig


class Frames(list):
    """Images in memory."""

    signature = 'memory'


def sequence(name, size, frames, first=0):
    """Return a rendered sequence, whose target is absent before frame `first`."""
    scene = list(render_scene(SceneConfig(*size, frames=frames, target_height=0.3)))
    truth = np.array([frame.box.as_tuple() for frame in scene])
    truth[:first] = np.nan
    return TrackingSequence(name, 'rendered', Frames(frame.image for frame in scene), truth)


@pytest.fixture(scope='module')
def sequences():
    """Return a wide, a tall and a late sequence."""
    return [sequence('wide', (160, 96), 90), sequence('tall', (96, 128), 80),
            sequence('late', (96, 96), 80, first=5)]


@pytest.fixture(scope='module')
def parts(sequences):
    return join(sequences, 260, SIZE, ('disappear_1s', 'shutter'))


def test_sequences_follow_each_other_until_the_recording_is_full(parts):
    assert [part.sequence.name for part in parts] == ['wide', 'tall', 'wide']
    assert [len(part) for part in parts] == [90, 80, 90]
    assert [part.sequence.challenge for part in parts] == ['disappear_1s', 'shutter',
                                                           'disappear_1s']


def test_last_part_is_cut_and_a_short_rest_left_out(sequences):
    assert [len(part) for part in join(sequences, 240, SIZE)] == [90, 80, 70]
    assert [len(part) for part in join(sequences, 229, SIZE)] == [90, 80]


def test_event_that_does_not_fit_is_left_out(sequences):
    # Three seconds and what is needed around them are longer than these sequences.
    assert join(sequences, 90, SIZE, ('disappear_3s',))[0].sequence.challenge == ''


def test_recording_needs_a_target_to_mark():
    with pytest.raises(SequenceError, match='first frame'):
        join([sequence('late', (96, 96), 80, first=5)], 80, SIZE)


@pytest.mark.parametrize('width, height, size, corner', [
    (320, 256, (640, 512), (0, 0)), (640, 480, (640, 480), (0, 16)),
    (473, 356, (640, 482), (0, 15)), (96, 128, (384, 512), (128, 0)),
    (1280, 512, (640, 256), (0, 128))])
def test_images_keep_their_proportions(width, height, size, corner):
    fit = Fit.of(width, height, (640, 512))
    assert (fit.size, fit.corner) == (size, corner)
    assert fit.scale[0] == pytest.approx(fit.scale[1], rel=0.005)


@pytest.mark.parametrize('shape', [(256, 320), (128, 96), (700, 900)])
def test_boxes_stay_on_what_they_hold(shape):
    image = np.full(shape, 60, np.uint8)
    image[40:72, 30:70] = 200
    fit = Fit.of(shape[1], shape[0], SIZE)
    frame = fit.image(image)
    assert frame.shape == SIZE[::-1] and frame.dtype == np.uint8
    x, y, width, height = fit.boxes(np.array([[30., 40., 40., 32.]]))[0]
    rows, columns = np.nonzero(frame > 130)
    expected = columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1
    np.testing.assert_allclose((x, y, width, height), expected, atol=1)
    # Beside the image nothing stands out.
    assert set(np.unique(frame[0])) == {60}


def test_truth_comes_back_from_its_file(parts, tmp_path):
    write_truth(parts, tmp_path / 'truth.csv')
    read = read_truth(tmp_path / 'truth.csv', SIZE)
    assert len(read) == len(parts)
    for info, part in zip(read, parts):
        assert (info.name, info.challenge) == (part.sequence.name, part.sequence.challenge)
        np.testing.assert_allclose(info.ground_truth, part.truth, atol=1e-3)
    assert is_absent(read[0].ground_truth).sum() == 30


def test_recording_goes_through_the_node(parts, tmp_path):
    """Every frame is answered; each mark starts a target; figures and picture are written."""
    bag, played = tmp_path / 'recording', tmp_path / 'played'
    write_bag(parts[:2], bag)
    write_truth(parts[:2], tmp_path / 'truth.csv')
    infos = read_truth(tmp_path / 'truth.csv', SIZE)
    images = list(BagImages(bag, '/image_raw'))
    assert [image.stamp_ns for image in images] == [stamp_of(index) for index in range(170)]
    exchanges = play(bag, played, {'preset': 'default'}, rate=0)
    assert [item.answer.status.track_id for item in exchanges] == [1] * 90 + [2] * 80
    write_answers(exchanges, tmp_path / 'answers.csv')
    answers = list(in_parts(infos, read_answers(tmp_path / 'answers.csv')))
    for part, answer in zip(parts, answers):
        np.testing.assert_allclose(answer.boxes[0], part.mark.as_tuple(), atol=0.01)
    assert '| **in all** (2 parts) | 170 | 170 |' in event_table(infos, answers)
    assert '| rendered/wide, gone for 1 s | 90 | 90 |' in part_table(infos, answers)
    draw_sheet(infos, answers, [True, True], played, tmp_path / 'moments.jpg')
    assert (tmp_path / 'moments.jpg').stat().st_size > 10_000


def test_figures_of_known_answers():
    """A loss that is told after two frames, and a return that is found after three."""
    truth = np.tile([100., 100., 20., 20.], (120, 1))
    truth[40:70] = np.nan
    states = np.array(['tracking'] * 42 + ['lost'] * 31 + ['tracking'] * 47)
    boxes = np.tile([100., 100., 20., 20.], (120, 1))
    boxes[states == 'lost'] = np.nan
    # The node dropped one frame.
    states[100], boxes[100] = '', np.nan
    latencies = np.where(states == '', np.nan, 10.0)
    part = SequenceInfo('one', 'group', SIZE, truth, {}, 'disappear_1s')
    text = part_table([part], [Answers(states, np.full(120, 0.5), latencies, boxes)])
    row = text.splitlines()[2].split(' | ')
    assert row[1:6] == ['120', '119', '10.0', '10.0', '10.0']
    assert row[6:9] == [f'{count / 119:.3f}'.lstrip('0') for count in (88, 0, 31)]
    assert row[9] == f'{(90 - 4) / 90:.3f}'.lstrip('0')
    assert row[10:] == ['1 of 1', '2', '1 of 1', '3 |']


def test_moments_lie_where_they_say():
    truth = np.tile([100., 100., 20., 20.], (200, 1))
    plain = SequenceInfo('one', 'group', SIZE, truth.copy(), {}, '')
    assert chosen_moments(plain) == []
    truth[80:110] = np.nan
    gone = SequenceInfo('one', 'group', SIZE, truth, {}, 'disappear_1s')
    absent = {moment.title: is_absent(truth[moment.frame:moment.until + 1])
              for moment in chosen_moments(gone)}
    assert all(len(flags) for flags in absent.values())
    assert absent.pop('gone').all() and not any(flags.any() for flags in absent.values())
