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

"""A walker before a noisy ground."""

import cv2
import numpy as np
import pytest

IMAGE_SIZE = (256, 192)


def _walker_images(places, wall=(0, 0, 0, 0)):
    """Yield 16-bit images of a walker at places (left, top), behind a wall in places."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.normal(0, 1, IMAGE_SIZE[::-1]), (0, 0), 6)
    ground = 7300 + 120 * ground / ground.std()
    y, x = np.mgrid[:IMAGE_SIZE[1], :IMAGE_SIZE[0]]
    hidden = slice(wall[1], wall[3]), slice(wall[0], wall[2])
    for left, top in places:
        image = ground.copy()
        image[np.hypot((x - left - 9) / 8.5, (y - top - 26) / 16) < 1] += 400
        image[np.hypot((x - left - 9) / 5, (y - top - 6) / 6) < 1] += 500
        image[hidden] = 7250
        image = cv2.GaussianBlur(image, (0, 0), 0.8) + rng.normal(0, 8, image.shape)
        yield image.astype(np.uint16)


@pytest.fixture
def walker_images():
    """Return what yields images of a walker of 18 x 42 pixels in an image of 256 x 192."""
    return _walker_images
