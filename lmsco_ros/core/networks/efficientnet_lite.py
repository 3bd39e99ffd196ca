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

"""EfficientNet-Lite0 (Tan and Le, ICML 2019) up to the last block with cells of 16 pixels."""

from __future__ import annotations

from lmsco_ros.core.networks.inverted_residual import blocks, Group, InvertedResidualNetwork

__all__ = ['EfficientNetLite0']

_PARTS = {'expand': ('expand_conv', 'bn0'), 'depthwise': ('depthwise_conv', 'bn1'),
          'project': ('project_conv', 'bn2')}


class EfficientNetLite0(InvertedResidualNetwork):
    """
    Eleven blocks; the smallest of the family, without attention to channels.

    On S + 2 `margin` pixels, S a multiple of 16, every layer has exactly S / stride cells per
    axis.
    """

    plan = blocks((Group(1, 16, expansion=1), Group(2, 24, stride=2),
                   Group(2, 40, stride=2, kernel=5), Group(3, 80, stride=2),
                   Group(3, 112, kernel=5)), late=True)
    aliases = {'shallow': 'conv1', 'deep': 'block11'}
    epsilon = 1e-3
    mean = (127.0, 127.0, 127.0)
    deviation = (128.0, 128.0, 128.0)

    @classmethod
    def published(cls) -> dict[str, tuple[str, str]]:
        """Return the names of the PyTorch port, which counts the blocks from 0."""
        found = {'conv1': ('_conv_stem', '_bn0')}
        for number, (name, block) in enumerate(cls.plan.items()):
            within = f'_blocks.{number}._'
            found.update({f'{name}.{part}': (within + convolution, within + normalization)
                          for part, (convolution, normalization) in _PARTS.items()
                          if part != 'expand' or block.expansion > 1})
        return found
