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

"""The objective of the training, followed over a sequence."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks import objective
from benchmarks.scenes import moving_scene
from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.learning.structured_operator import StructuredOperator

CONFIG = TrackerConfig.preset('default')
FRAMES = 8


@pytest.fixture(scope='module')
def lesson():
    """Return what the default tracker learned from in a short scene."""
    return objective.record_lesson(CONFIG, moving_scene((320, 256), 30, FRAMES + 1))


def test_every_loss_is_lowest_where_it_is_trained_longest(lesson):
    """All values are finite, and no short training gets below the long one."""
    values = objective.compare(lesson, CONFIG.learning)
    own, paper, converged = (budget.name for budget in objective.budgets(CONFIG.learning))
    assert len(values) == 3 * len(objective.LOSSES)
    for loss in objective.LOSSES:
        assert values[loss, own].shape == (FRAMES,)
        for budget in (own, paper):
            assert np.isfinite(values[loss, budget]).all()
            assert (values[loss, budget] > values[loss, converged]).all()


@pytest.mark.parametrize('loss', objective.LOSSES)
def test_the_reference_has_converged(lesson, loss):
    """Training it twice as long gains less than three percent."""
    reference = replace(CONFIG.learning, **objective.LOSSES[loss], **objective.CONVERGED)
    longer = replace(reference, iterations=2 * reference.iterations)
    gained = objective.follow(lesson, reference) / objective.follow(lesson, longer) - 1
    assert np.abs(gained).max() < 0.03


def test_a_filter_that_follows_is_that_of_the_tracker(lesson):
    """The same configuration on the recorded samples has the objective of the tracker's own."""
    trained = []

    class Witness(StructuredOperator):

        def train(self):
            super().train()
            trained.append(self.objective())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(objective, 'StructuredOperator', Witness)
        objective.record_lesson(CONFIG, moving_scene((320, 256), 30, FRAMES + 1))
    again = objective.follow(lesson, CONFIG.learning)
    interval = CONFIG.learning.update_interval
    numbers = np.array(list(lesson.samples))
    np.testing.assert_allclose(again[numbers % interval == 0], trained, rtol=1e-5)


def test_command_prints_the_table_and_writes_the_picture(tmp_path, capsys):
    """Three losses with three budgets each."""
    objective.main(['--frames', '3', '--output', str(tmp_path / 'new' / 'objective.png')])
    printed = capsys.readouterr().out
    assert 'rendered scene, 3 samples of 3 frames' in printed
    assert printed.count(' | 1.000 | 1.000 | 1.000 |') == len(objective.LOSSES)
    assert (tmp_path / 'new' / 'objective.png').read_bytes().startswith(b'\x89PNG')


def test_command_follows_a_recorded_sequence(tmp_path, capsys):
    """Its folder names data set, group and sequence."""
    clip, folder = moving_scene((320, 256), 30, 6), tmp_path / 'data' / 'group' / 'name'
    (folder / 'ir').mkdir(parents=True)
    for number, frame in enumerate(clip.frames, start=1):
        cv2.imwrite(str(folder / 'ir' / f'{number:08d}.png'), frame)
    np.savetxt(folder / 'groundtruth.txt', clip.truth, delimiter=',')
    objective.main(['--frames', '3', '--sequence', str(folder),
                    '--output', str(tmp_path / 'objective.png')])
    assert 'group/name, 3 samples of 3 frames' in capsys.readouterr().out
