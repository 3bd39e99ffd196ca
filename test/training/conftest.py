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

"""Clips and stills with a bright target whose place and size are known."""

import numpy as np
import pytest
import torch

from lmsco_ros.core.types import BoundingBox
from training.sources import Clip, Still

SIZE = (200, 160)
TARGET = (36.0, 24.0)
# Standard deviation of the bright spot over the sides of the box.
SPOT = 0.15


@pytest.fixture(scope='session', autouse=True)
def single_thread():
    """Let small arrays be computed by one thread."""
    torch.set_num_threads(1)


@pytest.fixture
def rng():
    """Return a random generator that starts the same way in every test."""
    return np.random.default_rng(7)


def spot(center, target=TARGET, size=SIZE):
    """Return an 8-bit image with a Gaussian spot in a box around a center."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    u, v = (x - center[0]) / (SPOT * target[0]), (y - center[1]) / (SPOT * target[1])
    return np.round(20 + 200 * np.exp(-0.5 * (u**2 + v**2))).astype(np.uint8)


@pytest.fixture(name='spot')
def spot_fixture():
    """Return the picture of a spot."""
    return spot


@pytest.fixture(scope='session')
def clip():
    """Return a clip of a target that moves and grows, and is gone in two of its frames."""
    centers = [(60 + 3 * n, 70 + 1.7 * n) for n in range(20)]
    sides = [(TARGET[0] * 1.02**n, TARGET[1] * 1.01**n) for n in range(20)]
    frames = np.stack([spot(*pair) for pair in zip(centers, sides, strict=True)])
    boxes = np.array([BoundingBox.from_center(*pair).as_tuple()
                      for pair in zip(centers, sides, strict=True)])
    boxes[[4, 11]] = np.nan
    frames[[4, 11]] = 255
    return Clip('made/up', frames, boxes)


@pytest.fixture(scope='session')
def still():
    """Return an image with a target."""
    return Still(spot((110.3, 81.6)), (BoundingBox.from_center((110.3, 81.6), TARGET),))


def moments(patch):
    """Return middle (x, y) and standard deviations (x, y) of the one spot in a patch."""
    patch = np.abs(patch.astype(float) - np.median(patch))
    patch[patch < 0.02 * patch.max()] = 0
    y, x = np.mgrid[:patch.shape[0], :patch.shape[1]] + 0.5
    middle = [np.sum(patch * axis) / patch.sum() for axis in (x, y)]
    spread = [np.sqrt(np.sum(patch * (axis - m)**2) / patch.sum())
              for axis, m in zip((x, y), middle, strict=True)]
    return np.array(middle), np.array(spread)


@pytest.fixture(name='moments')
def moments_fixture():
    """Return the measurement of a spot."""
    return moments
