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

"""Small recordings of every kind."""

import cv2
import numpy as np
import pytest

from lmsco_ros.replay.frame import Frame


def counts(index, shape=(48, 64), dtype=np.uint16):
    """Return an image that is different for every index."""
    image = np.random.default_rng(index).integers(0, 200, shape)
    return (image + (7000 if dtype == np.uint16 else 0)).astype(dtype)


@pytest.fixture
def frames():
    """Return ten 16-bit frames at 25 Hz."""
    return [Frame(i, i * 40_000_000, counts(i)) for i in range(10)]


@pytest.fixture
def folder(tmp_path, frames):
    """Return a folder of 16-bit images whose names need natural order."""
    path = tmp_path / 'images'
    path.mkdir()
    for frame in frames:
        cv2.imwrite(str(path / f'frame{frame.index + 1}.png'), frame.image)
    return path


@pytest.fixture
def video(tmp_path):
    """Return a film of twelve gray frames at 20 Hz; frame i has the brightness 10 i + 50."""
    path = tmp_path / 'film.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*'MJPG'), 20, (64, 48))
    for index in range(12):
        writer.write(np.full((48, 64, 3), 10 * index + 50, np.uint8))
    writer.release()
    return path
