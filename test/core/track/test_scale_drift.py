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

"""The search over scales keeps the size of a target that stands still, and follows a change."""

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig

CENTER = (80.3, 60.4)


def sizes(config, drawn, seed=5, frames=41):
    """
    Return how large a target is told to be, as a part of its size in the first frame.

    A warm ellipse of `drawn` (frame number to side) before uneven ground; every frame has its
    own noise.
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:120, :160] + 0.5
    ground = 90 + 8 * np.sin(x / 9) * np.cos(y / 7) + 0.1 * x
    tracker, told = LMSCOTracker(config), []
    for number in range(frames):
        side = drawn(number)
        apart = (np.square(x - CENTER[0]) + 2 * np.square(y - CENTER[1])) / (side / 2)**2
        target = 90 / (1 + np.exp((8 * (apart - 1)).clip(max=50)))
        image = ground + target + rng.normal(0, 2, ground.shape)
        image = image.clip(0, 255).astype(np.uint8)
        box = BoundingBox.from_center(CENTER, (side, side / 2**0.5))
        result = tracker.update(image) if number else tracker.initialize(image, box)
        told.append((result.box.area / box.area)**0.5 * side / drawn(0))
    return np.array(told)


def configured(**scale):
    """Return a tracker that searches over the paper's ten scales, on handcrafted channels."""
    return TrackerConfig.from_dict({
        'preset': 'hcs', 'sampling': {'patch_size_min': 100, 'patch_size_max': 100},
        'scale': scale})


@pytest.mark.parametrize('side', [9, 16, 36])
@pytest.mark.parametrize('seed', [5, 6])
def test_a_static_target_keeps_its_size(side, seed):
    told = sizes(configured(), lambda number: side, seed)
    assert np.abs(told - 1).max() < 0.02


@pytest.mark.parametrize('side', [9, 16, 36])
def test_without_calibration_the_size_of_a_static_target_drifts(side):
    """What the calibration is for: the score is not highest at the size of the first frame."""
    told = sizes(configured(calibrated=False, rate=1.0), lambda number: side)
    assert told[-1] > 1.05


@pytest.mark.parametrize('growth', [1.01, 0.99])
def test_a_growing_and_a_shrinking_target_are_followed(growth):
    told = sizes(configured(), lambda number: 30 * growth**number, frames=41)
    assert told[-1] == pytest.approx(growth**40, rel=0.05)
