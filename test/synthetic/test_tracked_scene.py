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

"""The default tracker in the rendered scene, whose truth is known."""

import numpy as np

from lmsco_ros.core import LMSCOTracker
from lmsco_ros.synthetic import render_scene, SceneConfig


def test_walker_that_comes_nearer_and_goes_away_is_followed_in_size():
    """Its height doubles within eight seconds and halves again; a post and a twin are near."""
    first, *frames = render_scene(SceneConfig())
    tracker = LMSCOTracker()
    tracker.initialize(first.image, first.box)
    boxes = [tracker.update(frame.image).box for frame in frames]
    sizes = np.log([(frame.box.height, box.height)
                    for frame, box in zip(frames, boxes, strict=True)])
    true, shown = (sizes - np.log(first.box.height)).T
    assert true.max() > 0.4
    assert np.polyfit(true, shown, 1)[0] > 0.55
    assert abs(shown[-30:].mean() - true[-30:].mean()) < 0.15
    assert np.mean([box.overlap(frame.box)
                    for frame, box in zip(frames, boxes, strict=True)]) > 0.7
