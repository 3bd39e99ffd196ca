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

"""Views of a target of some size."""

import pytest

from lmsco_ros.core.config import IntensityConfig
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.view import FrameView

CENTER = (83.3, 60.7)


@pytest.fixture
def view(make_scene):
    """Return the function that shows a target of some size."""
    scene = make_scene()
    gain = AutomaticGain(IntensityConfig())

    def show(target, center=CENTER):
        image = scene.frame(center, target)
        return FrameView(image, gain.observe(image))

    return show
