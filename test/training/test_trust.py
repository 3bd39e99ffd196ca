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

"""What the trust in a detection is fitted to, and the fit."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core import TrackerConfig
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.split import load_split
from training.sources import SPLIT
from training.trust import fit, main, miscalibration, Model, record, Records, separation

ABSENT = range(12, 18)


@pytest.fixture
def sequence(spot):
    """Return a target that moves, and is not there in some frames."""
    centers = [(60 + 1.5 * n, 70 + n) for n in range(24)]
    rng = np.random.default_rng(1)
    noise = rng.integers(0, 4, (24, 160, 200)).astype(np.uint8)
    frames = [20 + noise[n] if n in ABSENT else spot(center) + noise[n]
              for n, center in enumerate(centers)]
    truth = np.array([[x - 18, y - 12, 36, 24] for x, y in centers], float)
    truth[list(ABSENT)] = np.nan
    return TrackingSequence('up', 'made', frames, truth)


def test_record_tells_what_spoke_for_every_frame_after_the_first(sequence):
    records = record(sequence, TrackerConfig.preset('default'))
    absent = np.isin(np.arange(1, 24), ABSENT)
    assert records.hints.shape == (23, 4) and records.overlap.shape == (23,)
    assert np.all(records.overlap[absent] == 0)
    there = records.overlap > 0.5
    assert there[:11].all()
    # The less sharp, alike and present, and the vaguer.
    good, bad = records.hints[:11], records.hints[absent]
    assert np.all(bad.max(axis=0)[:3] < good.min(axis=0)[:3])
    assert bad[:, 3].min() > good[:, 3].max()


def model(columns, overlap=0.5):
    """Return what is to be fitted."""
    return Model('TEST', columns, overlap)


def test_fit_separates_what_can_be_separated():
    rng = np.random.default_rng(3)
    hints = rng.normal(0, 1, (300, 4))
    hints[:100, 1] += 4
    records = [Records(hints, np.repeat([0.8, 0.0, 0.3], 100))]
    both, one = model((0, 1, 2, 3)), model((0,))
    weights = fit(records, both)
    assert weights[1] > 3 * np.abs(weights[[0, 2, 3]]).max()
    assert separation(records, both, weights) > 0.98
    assert separation(records, one, weights[[0, 4]]) < 0.7
    assert miscalibration(records, both, weights) < 0.05
    assert miscalibration(records, both, weights + [0, 0, 0, 0, 6]) > 0.1


def test_box_on_a_part_of_the_target_is_good_for_the_belief_alone():
    hints = np.random.default_rng(3).normal(0, 1, (200, 4))
    hints[:100, 2] += 4
    records = [Records(hints, np.repeat([0.3, 0.0], 100))]
    belief = model((0, 1, 2, 3), 0.0)
    assert fit(records, belief)[2] > 1
    assert separation(records, belief, fit(records, belief)) > 0.98
    assert np.isnan(separation(records, model((2,)), np.ones(2)))


KNOWN = sorted(load_split(SPLIT).parts['train'])[0]


@pytest.mark.parametrize(('words', 'reason'), [
    (('--data', '{folder}/empty'), 'arguments are required: --rendered'),
    (('--data', '{folder}/missing'), 'missing holds no folder thermal_dev'),
    (('--data', '{folder}/empty', '--rendered', '{folder}'), 'thermal_dev holds no sequence'),
    (('--data', '{folder}/other', '--rendered', '{folder}'),
     "no sequence of this dataset is in part 'train'"),
    (('--data', '{folder}/empty', '--rendered', '{folder}', '--frames', '1'),
     'at least 2 are needed'),
    (('--data', '{folder}/known', '--rendered', '{folder}/missing'), 'missing is not a folder'),
    (('--data', '{folder}/known', '--rendered', '{folder}/empty'), 'empty holds no sequence'),
])
def test_data_that_is_not_there_is_told_in_a_line(tmp_path, capsys, words, reason):
    (tmp_path / 'empty' / 'thermal_dev').mkdir(parents=True)
    for clip in (tmp_path / 'other' / 'thermal_dev' / 'group' / 'clip',
                 tmp_path / 'known' / 'thermal_dev' / KNOWN):
        clip.mkdir(parents=True)
        cv2.imwrite(str(clip / '1.png'), np.zeros((20, 20), np.uint8))
        (clip / 'groundtruth.txt').write_text('1,2,3,4')
    with pytest.raises(SystemExit) as end:
        main([word.format(folder=tmp_path) for word in words])
    assert end.value.code == 2
    assert reason in capsys.readouterr().err.splitlines()[-1]
