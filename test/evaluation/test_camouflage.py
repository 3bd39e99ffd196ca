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

"""A target that fades into its surroundings: how far, when, and what stays as it is."""

import numpy as np
import pytest

from lmsco_ros.evaluation.challenges import apply_challenge

GROUND, TARGET = 70.0, 220.0


@pytest.mark.parametrize('dtype', [np.uint8, np.uint16, np.float32])
def test_target_fades_to_a_quarter_of_its_contrast(sequence, inside, dtype):
    made = apply_challenge(sequence(dtype=dtype), 'camouflage')
    plain = sequence(dtype=dtype)
    assert np.array_equal(made.ground_truth, plain.ground_truth)

    def contrast(index):
        box = made.ground_truth[index]
        left = slice(int(box[1]), int(box[1] + box[3])), slice(int(box[0]) - 9, int(box[0]) - 5)
        return (inside(made.frames[index], box).mean() - made.frames[index][left].mean()) / (
            TARGET - plain.frames[index][left].mean())
    assert contrast(20) == pytest.approx(1, abs=0.01)
    assert contrast(49) == pytest.approx(1, abs=0.01)
    fading = [contrast(index) for index in range(50, 66)]
    assert all(np.diff(fading) < 0.02) and fading[7] == pytest.approx(0.6, abs=0.06)
    assert [contrast(index) for index in (65, 100, 149)] == pytest.approx([0.25] * 3, abs=0.06)
    assert made.frames[100].dtype == dtype


def test_surroundings_and_first_third_stay_as_they_are(sequence):
    plain, made = sequence(), apply_challenge(sequence(), 'camouflage')
    assert np.array_equal(made.frames[49], plain.frames[49])
    x, y, width, height = np.round(made.ground_truth[120]).astype(int)
    changed = made.frames[120] != plain.frames[120]
    changed[y - 4:y + height + 4, x - 4:x + width + 4] = False
    assert not changed.any()
    assert np.array_equal(made.frames[120], made.frames[120])


def test_frames_without_the_target_stay_as_they_are(sequence):
    plain = sequence()
    made = apply_challenge(sequence(), 'camouflage')
    gone = sequence()
    gone.ground_truth[100] = np.nan
    assert np.array_equal(apply_challenge(gone, 'camouflage').frames[100], plain.frames[100])
    assert not np.array_equal(made.frames[100], plain.frames[100])
