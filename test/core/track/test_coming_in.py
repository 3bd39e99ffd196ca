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

"""Targets that are marked while the border of the image cuts them."""

import cv2
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackState
from lmsco_ros.core.config import ExtentConfig
from lmsco_ros.core.imaging.regions import visible_part

IMAGE_SIZE = (256, 192)


def walker_at(places):
    """Yield images of a walker before a noisy ground, with the box of what is in view of it."""
    rng = np.random.default_rng(0)
    ground = cv2.GaussianBlur(rng.normal(0, 1, IMAGE_SIZE[::-1]), (0, 0), 6)
    ground = 7300 + 120 * ground / ground.std()
    y, x = np.mgrid[:IMAGE_SIZE[1], :IMAGE_SIZE[0]]
    for left, top in places:
        image = ground.copy()
        image[np.hypot((x - left - 9) / 8.5, (y - top - 26) / 16) < 1] += 400
        image[np.hypot((x - left - 9) / 5, (y - top - 6) / 6) < 1] += 500
        image = cv2.GaussianBlur(image, (0, 0), 0.8) + rng.normal(0, 8, image.shape)
        yield image.astype(np.uint16), visible_part(BoundingBox(left, top, 18, 42), IMAGE_SIZE)


@pytest.mark.parametrize('start, step, shown', [
    ((-12, 70), (1.2, 0.2), (6, 42)), ((-10, 70), (0.5, 0.1), (8, 42)),
    ((100, 180), (0.4, -1.2), (18, 12))], ids=['side', 'slowly', 'below'])
def test_whole_walker_is_followed_once_it_has_come_in(start, step, shown):
    """The tracker is started on a third of it, or less; the size of that covers a third."""
    frames = walker_at([np.add(start, np.multiply(step, n)) for n in range(80)])
    tracker = LMSCOTracker()
    image, visible = next(frames)
    assert visible.size == pytest.approx(shown)
    tracker.initialize(image, visible)
    overlaps = []
    for image, visible in frames:
        result = tracker.update(image)
        overlaps.append(result.box.overlap(visible))
        assert result.state is not TrackState.LOST
    assert visible.size == (18, 42)
    assert np.mean(overlaps[-20:]) > 0.65


def test_tracker_that_measures_nothing_keeps_the_size_of_the_part():
    """Nothing would tell it where the rest ends."""
    frames = walker_at([(-10 + 0.5 * n, 70) for n in range(30)])
    tracker = LMSCOTracker(TrackerConfig(extent=ExtentConfig(network='')))
    image, visible = next(frames)
    tracker.initialize(image, visible)
    for image, _ in frames:
        assert tracker.update(image).box.width <= visible.width + 1e-9
