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

"""Two checkouts answer the same frames; what differs is counted, and decides the status."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import same_answers
from benchmarks.answers_process import answers as track
from benchmarks.same_answers import challenged, compare, Comparison
from lmsco_ros.core import BoundingBox, TrackState
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError

REPOSITORY = Path(same_answers.__file__).parents[1]

# A tracker of the same interface that moves by two pixels a frame, and is never sure.
OTHER_CORE = """\
from collections import namedtuple
from enum import Enum

BoundingBox = namedtuple('BoundingBox', 'x y width height')
BoundingBox.as_tuple = lambda self: tuple(self)
TrackState = Enum('TrackState', {'TRACKING': 'tracking', 'LOST': 'lost'})
Result = namedtuple('Result', 'box state score')


class TrackerConfig:
    preset = staticmethod(str)


class LMSCOTracker:
    def __init__(self, config):
        pass

    def initialize(self, image, box):
        self._box = box
        return Result(box, TrackState.TRACKING, 1.0)

    def update(self, image):
        self._box = self._box._replace(x=self._box.x + 2)
        return Result(self._box, TrackState.LOST, 0.25)
"""


@pytest.fixture
def sequence():
    """Return a sequence of five frames, in the first of which the target is absent."""
    rng = np.random.default_rng(2)
    ground = rng.integers(90, 120, (96, 128)).astype(np.uint8)
    frames, boxes = [], []
    for n in range(5):
        frame = ground.copy()
        x = 40 + 2 * n
        if n:
            frame[40:56, x:x + 16] = 220
        frames.append(frame)
        boxes.append((x, 40, 16, 16) if n else (np.nan,) * 4)
    return TrackingSequence('walk', 'made', frames, np.array(boxes, float))


def answers(boxes, states, scores):
    """Return the answers of a checkout."""
    return {'boxes': np.array(boxes, float), 'states': np.array(states),
            'scores': np.array(scores)}


def test_same_answers_differ_nowhere():
    one = answers([(1, 2, 3, 4), (2, 2, 3, 4)], ['tracking', 'lost'], [1.0, 0.2])
    assert compare('a', one, one) == Comparison('a', 2, 0, 0, 0.0)


def test_frames_with_other_boxes_and_states_are_counted_and_scores_measured():
    before = answers([(1, 2, 3, 4)] * 4, ['tracking'] * 4, [1.0, 0.5, 0.5, 0.5])
    after = answers([(1, 2, 3, 4), (1, 2, 3, 4.5), (0, 0, 3, 4), (1, 2, 3, 4)],
                    ['tracking', 'lost', 'tracking', 'tracking'], [1.0, 0.25, 0.5, 0.625])
    assert compare('a', before, after) == Comparison('a', 4, 2, 1, 0.25)


def test_smallest_difference_of_a_box_counts():
    """Bit for bit: what rounding would hide is found."""
    before = answers([(1, 2, 3, 4)], ['lost'], [0.5])
    after = answers([(1, 2, 3, np.nextafter(4, 5))], ['lost'], [0.5])
    assert compare('a', before, after).boxes == 1


def test_sequences_that_match_are_challenged_as_well(sequence):
    other = replace(sequence, name='stand')
    found = list(challenged([sequence, other], 'made/w*', ['polarity', 'nan']))
    assert found[:2] == [sequence, other]
    assert [made.full_name for made in found[2:]] == ['made/walk+polarity', 'made/walk+nan']


def test_challenge_that_does_not_fit_is_passed_over(sequence, monkeypatch):
    def apply(sequence, name):
        if name == 'nan':
            raise SequenceError('it is too short')
        return replace(sequence, name=name)

    monkeypatch.setattr(same_answers, 'apply_challenge', apply)
    found = challenged([sequence], '*', ['nan', 'polarity'])
    assert [made.name for made in found] == ['walk', 'polarity']


def test_checkout_beside_itself_answers_the_same(sequence):
    """Both processes see the frames from the first one with a target on."""
    rows = same_answers.run(iter([sequence, sequence]), [REPOSITORY, REPOSITORY], 'hcs', None)
    assert rows == 2 * [Comparison(sequence.full_name, 4, 0, 0, 0.0)]


@pytest.fixture
def other_checkout(tmp_path):
    """Return a folder with another tracker."""
    package = tmp_path / 'other' / 'lmsco_ros'
    package.mkdir(parents=True)
    (package / '__init__.py').touch()
    (package / 'core.py').write_text(OTHER_CORE)
    return package.parent


def test_each_process_tracks_with_its_own_checkout(sequence, other_checkout):
    row, = same_answers.run(iter([sequence]), [other_checkout, REPOSITORY], 'hcs', 3)
    assert row.frames == 3 and row.boxes == 2 and row.states == 2
    assert row.score == pytest.approx(0.75, abs=0.05)


def test_folder_without_a_tracker_is_an_error(sequence, tmp_path, capfd):
    """The process says why, and its end does not go unnoticed."""
    with pytest.raises(RuntimeError, match='the tracker ended with status 1'):
        same_answers.run(iter([sequence]), [tmp_path / 'nothing', REPOSITORY], 'nowhere', None)


@pytest.mark.parametrize('status', [0, 1])
def test_command_tells_what_differs_and_its_status_says_so(
        sequence, other_checkout, monkeypatch, capsys, status):
    class Split:
        def select(self, part, sequences):
            assert part == 'val'
            return sequences

    class Found:
        sequences = [sequence]

    monkeypatch.setattr(same_answers, 'scan_dataset', lambda folder: Found)
    monkeypatch.setattr(same_answers, 'load_split', lambda path: Split())
    before = other_checkout if status else REPOSITORY
    assert same_answers.main(['DATA', '--before', str(before), '--preset', 'hcs',
                              '--part', 'val', '--frames', '3']) == status
    printed = capsys.readouterr().out
    assert f'1 sequences, 3 frames: boxes and states differ in {status} sequences' in printed
    assert ('| sequence | frames | other box |' in printed) == bool(status)


class Echo:
    """Answers with the number that an image is."""

    def initialize(self, image, box):
        assert box == BoundingBox(1, 2, 3, 4)
        return self.update(image)

    def update(self, image):
        return SimpleNamespace(box=BoundingBox(image, 2, 3, 4), score=image / 10,
                               state=TrackState.UNCERTAIN)


def test_process_answers_every_frame():
    found = track(Echo(), np.array([5, 6]), np.array([1, 2, 3, 4]))
    assert found['boxes'].tolist() == [[5, 2, 3, 4], [6, 2, 3, 4]]
    assert found['states'].tolist() == ['uncertain'] * 2 and found['scores'].tolist() == [.5, .6]
