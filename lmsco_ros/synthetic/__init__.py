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

"""Rendered thermal scenes with exact ground truth, for demonstrations and tests."""

from lmsco_ros.synthetic.scene import render_scene, SceneConfig, SceneFrame
from lmsco_ros.synthetic.story import render_story

__all__ = ['SceneConfig', 'SceneFrame', 'render_scene', 'render_story']
