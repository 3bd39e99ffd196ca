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

"""MobileNetV2 (Sandler et al., CVPR 2018) up to the last block with cells of 16 pixels."""

from __future__ import annotations

from lmsco_ros.core.networks.inverted_residual import blocks, Group, InvertedResidualNetwork

__all__ = ['MobileNetV2']


class MobileNetV2(InvertedResidualNetwork):
    """
    Thirteen blocks.

    On S + 2 `margin` pixels, S a multiple of 16, every layer has exactly S / stride cells per
    axis.
    """

    plan = blocks((Group(1, 16, expansion=1), Group(2, 24, stride=2), Group(3, 32, stride=2),
                   Group(4, 64, stride=2), Group(3, 96)))
    aliases = {'shallow': 'conv1', 'deep': 'block13'}
    epsilon = 1e-5
    mean = (123.675, 116.28, 103.53)
    deviation = (58.395, 57.12, 57.375)

    @classmethod
    def published(cls) -> dict[str, tuple[str, str]]:
        """Return the names of torchvision: conv1 and the blocks are `features` in their order."""
        found = {'conv1': ('features.0.0', 'features.0.1')}
        for number, (name, block) in enumerate(cls.plan.items(), start=1):
            parts = ['expand', 'depthwise'] if block.expansion > 1 else ['depthwise']
            within = f'features.{number}.conv'
            found.update({f'{name}.{part}': (f'{within}.{place}.0', f'{within}.{place}.1')
                          for place, part in enumerate(parts)})
            last = len(parts)
            found[f'{name}.project'] = (f'{within}.{last}', f'{within}.{last + 1}')
        return found
