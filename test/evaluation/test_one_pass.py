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

"""One-pass figures against hand-computed values."""

import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures

ABSENT = [np.nan] * 4


def test_four_frames_by_hand():
    truth = np.array([[0., 0, 10, 10]] * 4 + [ABSENT])
    answers = np.array([[0., 0, 10, 10],    # overlap 1, error 0
                        [5, 0, 10, 10],     # overlap 1/3, error 5
                        [0, 30, 10, 10],    # overlap 0, error 30
                        ABSENT,             # no answer
                        [0, 0, 10, 10]])    # target absent: not counted
    figures = one_pass_figures(truth, answers)
    # Above the thresholds 0 to 0.95 (20 of them) lies the first frame, above
    # 0 to 0.3 (7 of them) the second; nothing lies above 1.
    assert figures.success_auc == pytest.approx((20 + 7) / 4 / 21)
    assert figures.success[0] == 0.5 and figures.success[20] == 0
    assert figures.precision_at(5) == 0.5
    assert figures.precision_at(4) == 0.25
    assert figures.precision_at(20) == 0.5
    assert figures.precision_at(30) == 0.75
    # Errors as shares of the box: 0, 0.5, 3 and infinite; 0.5 is reached at the last
    # of the 51 thresholds only.
    assert figures.normalized_precision_auc == pytest.approx((51 + 1) / 4 / 51)


def test_normalized_precision_uses_each_side_of_the_box():
    truth, answer = np.array([[0., 0, 100, 10]]), np.array([[10., 0, 100, 10]])
    figures = one_pass_figures(truth, answer)
    assert figures.normalized_precision_auc == pytest.approx(41 / 51)
    assert one_pass_figures(truth, np.array([[0., 10, 100, 10]])).normalized_precision_auc == 0
