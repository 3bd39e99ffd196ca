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

"""
The presets: ours, then the paper and its ablation, one factor apart.

Values are given where they are not those of the section.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from lmsco_ros.core.config.extent import ExtentConfig, ScaleConfig
from lmsco_ros.core.config.features import ChannelConfig, FeatureConfig, NetworkConfig
from lmsco_ros.core.config.imaging import SamplingConfig
from lmsco_ros.core.config.learning import LearningConfig
from lmsco_ros.core.config.presence import PresenceConfig
from lmsco_ros.core.config.search import SearchConfig

__all__ = ['HANDCRAFTED', 'PRESETS']

HANDCRAFTED = (FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity', weight=4.0))),)
"""The block of the paper's `hcs`; intensity takes the place of the colors."""

_APPEARANCE = (FeatureConfig((ChannelConfig('appearance', layer='shallow'),), cell=4),
               FeatureConfig((ChannelConfig('appearance', layer='deep'),), cell=16))
_MOTION = (FeatureConfig((ChannelConfig('motion', layer='deep'),), cell=16),)

_DEFAULT: Mapping[str, Any] = {
    'features': (FeatureConfig((ChannelConfig('appearance', power=0.5, layer='features'),
                                *HANDCRAFTED[0].channels), projection=32),),
    'sampling': SamplingConfig(search_factor=4.0, patch_size_min=80, patch_size_max=80),
    'learning': LearningConfig(iterations=1, gradient_steps=1, update_interval=2),
    'extent': ExtentConfig('extent'),
}
_PAPER: Mapping[str, Any] = {
    'features': _APPEARANCE + _MOTION,
    'sampling': SamplingConfig(patch_size_min=200, patch_size_max=300),
    'networks': NetworkConfig('vgg_m_2048', 'motion_cnn'),
    'scale': ScaleConfig(exponent_min=-4, exponent_max=5),
    'presence': PresenceConfig(learn='always', distractors=False),
    'search': SearchConfig(candidates=0, tiles=0),
}
_UNSCALED = {**_PAPER, 'scale': ScaleConfig()}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType({
    'default': _DEFAULT,
    'paper': _PAPER,
    'mas': _PAPER,
    'ma': _UNSCALED,
    'a': {**_UNSCALED, 'features': _APPEARANCE},
    'hcs': {**_PAPER, 'features': HANDCRAFTED},
})
"""Arguments of `TrackerConfig` for each name."""
