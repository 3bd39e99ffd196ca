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

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackState
from lmsco_ros.core.config import ExtentConfig
from lmsco_ros.core.imaging.regions import visible_part

IMAGE_SIZE = (256, 192)


def visible(place):
    """Return what is in view of a walker at a place (left, top)."""
    return visible_part(BoundingBox(*place, 18, 42), IMAGE_SIZE)


@pytest.mark.parametrize('start, step, shown', [
    ((-12, 70), (1.2, 0.2), (6, 42)), ((-10, 70), (0.5, 0.1), (8, 42)),
    ((100, 180), (0.4, -1.2), (18, 12))], ids=['side', 'slowly', 'below'])
def test_whole_walker_is_followed_once_it_has_come_in(walker_images, start, step, shown):
    """The tracker is started on a third of it, or less; the size of that covers a third."""
    places = [np.add(start, np.multiply(step, n)) for n in range(80)]
    images, boxes = walker_images(places), [visible(place) for place in places]
    assert boxes[0].size == pytest.approx(shown) and boxes[-1].size == (18, 42)
    tracker = LMSCOTracker()
    tracker.initialize(next(images), boxes[0])
    results = [tracker.update(image) for image in images]
    assert TrackState.LOST not in [result.state for result in results]
    overlaps = [result.box.overlap(box)
                for result, box in zip(results[-20:], boxes[-20:], strict=True)]
    assert np.mean(overlaps) > 0.65


def test_tracker_that_measures_nothing_keeps_the_size_of_the_part(walker_images):
    """Nothing would tell it where the rest ends."""
    images = walker_images([(-10 + 0.5 * n, 70) for n in range(30)])
    tracker = LMSCOTracker(TrackerConfig(extent=ExtentConfig(network='')))
    tracker.initialize(next(images), visible((-10, 70)))
    assert all(tracker.update(image).box.width <= 8 + 1e-9 for image in images)
