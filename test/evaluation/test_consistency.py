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

"""Normalized errors squared against their definition, and honest errors in their band."""

from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lmsco_ros.evaluation.protocols.consistency import (
    consistency_band, largest_usual_error, normalized_errors)
from lmsco_ros.evaluation.trace import Trace

number = st.floats(-50, 50)
TRUTH = np.array([100., 80, 20, 10])


def traced(offsets, covariances):
    """Return truth, and a trace whose predicted centers are off by so much."""
    count = len(offsets)
    predicted = TRUTH + np.pad(offsets, ((0, 0), (0, 2)))
    return np.tile(TRUTH, (count, 1)), Trace(
        predicted, np.ones(count), np.zeros(count, bool), (0,), predicted=predicted,
        covariances=np.asarray(covariances))


@given(offset=arrays(float, 2, elements=number), root=arrays(float, (4, 4), elements=number))
def test_error_is_measured_by_the_covariance_of_the_center(offset, root):
    covariance = root @ root.T + np.eye(4)
    truth, trace = traced(offset[None], covariance[None])
    expected = offset @ np.linalg.solve(covariance[:2, :2], offset)
    assert normalized_errors(truth, trace)[0] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_frames_without_target_covariance_or_prediction_are_not_judged():
    truth, trace = traced(np.ones((4, 2)), np.tile(np.eye(4), (4, 1, 1)))
    truth[1] = np.nan
    trace.covariances[2] = np.nan
    trace.covariances[3, 0, 0] = -1
    assert np.isfinite(normalized_errors(truth, trace)).tolist() == [True, False, False, False]
    silent = Trace(truth, np.ones(4), np.zeros(4, bool), (0,))
    assert np.isnan(normalized_errors(truth, silent)).all()


def test_honest_errors_are_in_their_band():
    rng = np.random.default_rng(4)
    covariance = np.array([[4., 1.5], [1.5, 2.]])
    full = np.eye(4)
    full[:2, :2] = covariance
    means, inside = [], []
    for _ in range(400):
        offsets = rng.multivariate_normal([0, 0], covariance, 30)
        errors = normalized_errors(*traced(offsets, np.tile(full, (30, 1, 1))))
        means.append(errors.mean())
        inside.append((errors <= largest_usual_error()).mean())
    low, high = consistency_band(30)
    assert low < 2 < high and np.mean(inside) == pytest.approx(.95, abs=.01)
    assert np.mean([low < mean < high for mean in means]) == pytest.approx(.95, abs=.03)
