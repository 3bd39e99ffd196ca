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

"""Comparisons over starts that are off by chance: who gets what, what counts, what is told."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks import jittered_starts
from benchmarks.jittered_starts import (
    compare, jittered, main, Outcome, over_sequences, over_starts, read_trackers, run)
from lmsco_ros.core import TrackerConfig, TrackState
from lmsco_ros.core.errors import ConfigError
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.trackers import Answer

COMPARISONS = sorted(Path(jittered_starts.__file__).with_name('comparisons').glob('*.yaml'))


class Images:
    """Blank frames that count how often they are decoded."""

    signature = 'blank'

    def __init__(self, count):
        self.count, self.decoded = count, 0

    def __len__(self):
        return self.count

    def __getitem__(self, index):
        self.decoded += 1
        return np.zeros((60, 80), np.uint8)


def sequence_of(truth, name='one'):
    """Return a sequence of blank frames."""
    return TrackingSequence(name, 'group', Images(len(truth)), np.array(truth, float))


class Still:
    """Stays where it was started, and notes where that was."""

    in_process = True
    begun = []

    def __init__(self, config):
        self._config = config

    def initialize(self, image, box):
        """Note the start."""
        self._box = box
        Still.begun.append((self._config, box.as_tuple()))

    def update(self, image):
        """Answer with the first box, or with nothing where the memory is 7."""
        box = None if self._config.learning.memory_size == 7 else self._box
        return Answer(box, 1.0, TrackState.TRACKING)

    def close(self):
        """Do nothing."""


@pytest.fixture
def still(monkeypatch):
    """Put a tracker that stands still in the place of ours."""
    monkeypatch.setattr(jittered_starts, 'ConfiguredTracker', Still)
    monkeypatch.setattr(Still, 'begun', [])
    return Still


def test_starts_are_off_by_a_twentieth_and_the_same_each_time():
    sequence = sequence_of([[np.nan] * 4, [100, 50, 40, 10], [0, 0, 5, 5]])
    boxes = np.array([jittered(sequence, start) for start in range(2000)])
    np.testing.assert_array_equal(boxes[3], jittered(sequence, 3))
    other = jittered(sequence_of([[100, 50, 40, 10]], 'other'), 3)
    assert not np.array_equal(boxes[3], other)
    centers = boxes[:, :2] + boxes[:, 2:] / 2
    np.testing.assert_allclose(centers.mean(axis=0), (120, 55), atol=0.2)
    np.testing.assert_allclose(centers.std(axis=0), (2, 0.5), rtol=0.06)
    np.testing.assert_allclose(np.log(boxes[:, 2:] / (40, 10)).std(axis=0), 0.05, rtol=0.06)


def test_frames_after_the_start_count_and_the_end_tells_who_is_lost(still):
    """The tracker stands still while the target, after two frames, jumps away."""
    near, far = [20, 20, 20, 20], [55, 35, 20, 20]
    tracker = Still(TrackerConfig())
    stays = run(tracker, sequence_of([[np.nan] * 4, near, near, near, near]), 2)
    assert stays.success.shape == (2,) and stays.success.min() > 0.75 and not stays.lost.any()
    assert stays.precision.min() > 0.8 and stays.rate > 0
    half = run(tracker, sequence_of([near, near, far]), 2)
    np.testing.assert_array_equal(half.lost, [1, 1])
    assert half.success.max() <= 0.5
    # Where the target is absent at the end, the last frame that shows it tells.
    away = run(tracker, sequence_of([near, near, near, [np.nan] * 4]), 2)
    assert not away.lost.any() and away.success.min() > 0.75


def test_all_configurations_get_the_same_starts_and_each_frame_is_decoded_once(still):
    trackers = {'one': TrackerConfig(),
                'none': TrackerConfig.from_dict({'learning': {'memory_size': 7}})}
    sequences = [sequence_of([[10, 10, 8, 8]] * 4, name) for name in ('a', 'b')]
    outcomes = compare(trackers, sequences, 3)
    assert list(outcomes) == ['one', 'none']
    assert [len(some) for some in outcomes.values()] == [2, 2]
    begun = {name: [box for config, box in Still.begun if config == trackers[name]]
             for name in trackers}
    assert begun['one'] == begun['none'] and len(set(begun['one'])) == 6
    assert [sequence.frames.decoded for sequence in sequences] == [4, 4]
    # Without a box nothing is right, and the target is lost.
    assert all((some.success == 0).all() and some.lost.all() for some in outcomes['none'])


def test_a_tracker_that_fails_ends_the_comparison(still, monkeypatch):
    monkeypatch.setattr(still, 'update', lambda self, image: 1 / 0)
    with pytest.raises(SystemExit, match='group/one: frame 1: ZeroDivisionError'):
        run(still(TrackerConfig()), sequence_of([[10, 10, 8, 8]] * 4), 1)


def outcome(success, lost, rate=100.0):
    """Return an outcome with these successes."""
    return Outcome(np.array(success), np.array(success), np.array(lost, float), rate)


def cells(table):
    """Return the rows of a table by their first cell."""
    rows = [line.strip('| ').split(' | ') for line in table.splitlines()[2:]]
    return {row[0]: row[1:] for row in rows}


def test_differences_are_paired_over_sequences_or_over_starts():
    outcomes = {'first': [outcome([0.2, 0.4], [1, 0]), outcome([0.8, 0.8], [0, 0], 50.0)],
                'better': [outcome([0.3, 0.5], [0, 0]), outcome([0.9, 0.9], [0, 0])]}
    rows = cells(over_sequences(outcomes))
    # However unlike the sequences are, the difference is the same on each.
    assert rows['first'] == ['.550 (.300 – .800)', '.000 (.000 – .000)', '.550', '1 of 4', '67']
    assert rows['better'][:2] == ['.650 (.400 – .900)', '+.100 (.100 – .100)']
    rows = cells(over_starts(outcomes, 0))
    assert rows['first'][0] == '.300 (.200 – .400)' and rows['better'][1] == '+.100 (.100 – .100)'
    assert rows['first'][3] == '1 of 2'


def test_a_configuration_that_cannot_be_read_is_named(tmp_path):
    file = tmp_path / 'trackers.yaml'
    file.write_text('right: {preset: hcs}\nwrong: {learning: {lose: ridge}}\n')
    with pytest.raises(ConfigError, match=f"{file}: wrong: unknown key 'learning.lose'"):
        read_trackers(file)
    file.write_text('right: {preset: hcs}\nwrong: 3\n')
    with pytest.raises(ConfigError, match=f'{file}: wrong: '):
        read_trackers(file)


@pytest.mark.parametrize('file', COMPARISONS, ids=lambda path: path.stem)
def test_comparisons_of_the_repository_can_be_read(file):
    trackers = read_trackers(file)
    assert len(trackers) > 1 and len(set(map(repr, trackers.values()))) == len(trackers)


def test_command_writes_its_table_into_a_page(tmp_path, capsys):
    """On a bright target that moves over a soft ground, which both configurations follow."""
    images = tmp_path / 'data' / 'group' / 'walk' / 'ir'
    images.mkdir(parents=True)
    ground = np.random.default_rng(3).integers(40, 90, (96, 128)).astype(np.uint8)
    for number in range(6):
        image = ground.copy()
        image[30:44, 30 + number:46 + number] = 220
        cv2.imwrite(str(images / f'{number:08d}.png'), image)
    (images.parent / 'groundtruth.txt').write_text(
        ''.join(f'{30 + number},30,16,14\n' for number in range(6)))
    trackers, page = tmp_path / 'trackers.yaml', tmp_path / 'page.md'
    trackers.write_text('margin: {preset: hcs}\nridge: {preset: hcs, learning: {loss: ridge}}\n')
    page.write_text('before\n<!-- comparison -->\n<!-- /comparison -->\n')
    options = [str(tmp_path / 'data'), '--trackers', str(trackers), '--starts', '2',
               '--frames', '5']
    main([*options, '--page', str(page)])
    rows = cells(page.read_text().split('-->')[1].strip())
    assert list(rows)[:2] == ['margin', 'ridge']
    assert rows['margin'][3] == rows['ridge'][3] == '0 of 2'
    main([*options, '--each', '--only', '*/walk'])
    assert '`group/walk`' in capsys.readouterr().out
    # Several data sets are one comparison.
    main([str(tmp_path / 'data'), *options])
    assert {row[3] for row in cells(capsys.readouterr().out).values()} == {'0 of 4'}
    with pytest.raises(SystemExit, match='no sequence is left'):
        main([*options, '--only', 'nothing'])
    # Too short for this challenge.
    with pytest.raises(SystemExit, match='no sequence is left'):
        main([*options, '--challenge', 'start_on_noise'])
    assert 'group/walk is left out' in capsys.readouterr().out
