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

"""Configuration of the tracker: one module for each section, and the presets."""

from lmsco_ros.core.config.extent import ExtentConfig, ScaleConfig
from lmsco_ros.core.config.features import (
    ChannelConfig, FeatureConfig, MOTION_KINDS, MotionConfig, NETWORK_KINDS, NetworkConfig)
from lmsco_ros.core.config.imaging import IntensityConfig, SamplingConfig
from lmsco_ros.core.config.learning import LearningConfig
from lmsco_ros.core.config.presence import PresenceConfig
from lmsco_ros.core.config.runtime import RuntimeConfig
from lmsco_ros.core.config.search import SearchConfig
from lmsco_ros.core.config.tracker import TrackerConfig

__all__ = [
    'ChannelConfig', 'ExtentConfig', 'FeatureConfig', 'IntensityConfig', 'LearningConfig',
    'MOTION_KINDS', 'MotionConfig', 'NETWORK_KINDS', 'NetworkConfig', 'PresenceConfig',
    'RuntimeConfig', 'SamplingConfig', 'ScaleConfig', 'SearchConfig', 'TrackerConfig',
]
