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

"""What is expected of a target in more or less noise than there was."""

import pytest

from lmsco_ros.core.presence.expectation import Expectation


def learned(noise=0.0, frames=4):
    """Return what is expected after frames of sharpness 10 in so much noise."""
    expectation = Expectation(frames)
    expectation.note_noise(noise)
    for _ in range(frames):
        expectation.learn(10.0)
    return expectation


def test_all_is_as_expected_before_anything_is_learned():
    expectation = Expectation(4)
    expectation.note_noise(0.3)
    assert expectation.quality(0.2) == 1.0 and expectation.likeness(0.4) == 0.4


def test_sharpness_is_measured_against_the_median_of_the_first_frames():
    expectation = Expectation(3)
    for sharpness in (8.0, 100.0, 10.0, 500.0):
        expectation.learn(sharpness)
    assert expectation.quality(5.0) == 0.5


def test_noise_that_halves_the_sharpness_is_a_twentieth_of_the_range():
    expectation = learned()
    expectation.note_noise(0.05)
    assert expectation.quality(5.0) == pytest.approx(1.0)
    assert expectation.likeness(5 / 6) == pytest.approx(1.0)
    expectation.note_noise(0.25)
    assert expectation.likeness(0.5) == pytest.approx(1.0)


def test_noise_of_the_first_frames_is_usual():
    expectation = learned(noise=0.05)
    assert expectation.quality(10.0) == 1.0 and expectation.likeness(1.0) == 1.0
    expectation.note_noise(0.15)
    assert expectation.quality(5.0) == pytest.approx(1.0)


def test_less_noise_makes_nobody_expect_more():
    expectation = learned(noise=0.2)
    expectation.note_noise(0.0)
    assert expectation.quality(10.0) == 1.0 and expectation.likeness(1.0) == 1.0


@pytest.mark.parametrize('sharpness', [0.0, -1.0, float('nan'), float('inf')])
def test_what_is_no_sharpness_has_no_quality(sharpness):
    assert learned().quality(sharpness) == 0.0
