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

"""Networks of inverted residual blocks (Sandler et al., CVPR 2018), as tables of their blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import ClassVar

import numpy as np
import torch
from torch.nn import Conv2d, Identity, Module, ReLU6, ZeroPad2d

from lmsco_ros.core.networks.backbone import Layer
from lmsco_ros.core.networks.image_network import ImageNetwork
from lmsco_ros.core.networks.layers import fold_normalization

__all__ = ['Block', 'blocks', 'Group', 'InvertedResidual', 'InvertedResidualNetwork']

_STEM_CHANNELS = 32
_STEM_STRIDE = 2
_STEM_MIDDLE = 1.5
_NORMALIZATION = ('weight', 'bias', 'running_mean', 'running_var')


@dataclass(frozen=True)
class Group:
    """
    Blocks of one width; the first of them changes width and resolution.

    Attributes
    ----------
    number, channels : int
        How many blocks, and how wide what they give.
    stride : int
        Of the first block.
    kernel : int
        Side of the kernels of the depthwise convolutions.
    expansion : int
        Width inside of a block over that of its input.

    """

    number: int
    channels: int
    stride: int = 1
    kernel: int = 3
    expansion: int = 6


@dataclass(frozen=True)
class Block:
    """
    One block.

    Attributes
    ----------
    inputs, channels : int
        Width of its input and of its output.
    stride, kernel, expansion : int
        As of its group.
    before, after : int
        Cells of zeros that are put around the input of the depthwise convolution.

    """

    inputs: int
    channels: int
    stride: int
    kernel: int
    expansion: int
    before: int
    after: int


def blocks(groups: Sequence[Group], *, late: bool = False) -> dict[str, Block]:
    """
    Return the blocks of a network by their names, block1 and so on.

    Parameters
    ----------
    groups : sequence of Group
        From the first to the deepest.
    late : bool
        Whether zeros that cannot be shared evenly lie behind the input, as TensorFlow puts them,
        where a stride is 2; without it there are as many before as behind.

    """
    found, numbers, inputs = {}, count(1), _STEM_CHANNELS
    for group in groups:
        for index in range(group.number):
            stride = group.stride if index == 0 else 1
            behind = (group.kernel - 1) // 2
            before = (group.kernel - stride) // 2 if late else behind
            found[f'block{next(numbers)}'] = Block(
                inputs, group.channels, stride, group.kernel, group.expansion, before, behind)
            inputs = group.channels
    return found


class InvertedResidual(Module):
    """
    A wide depthwise convolution between two narrow layers, added to the input where it fits.

    Parameters
    ----------
    plan : Block
        Its sizes.

    """

    def __init__(self, plan: Block) -> None:
        super().__init__()
        wide = plan.expansion * plan.inputs
        self.expand = Conv2d(plan.inputs, wide, 1) if plan.expansion > 1 else Identity()
        even = plan.before == plan.after
        self.pad = Identity() if even else ZeroPad2d((plan.before, plan.after) * 2)
        self.depthwise = Conv2d(wide, wide, plan.kernel, plan.stride, groups=wide,
                                padding=plan.before if even else 0)
        self.project = Conv2d(wide, plan.channels, 1)
        self.rectify = ReLU6()
        self.shortcut = plan.stride == 1 and plan.inputs == plan.channels

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the features, shape (n, channels, H / stride, W / stride)."""
        wide = self.pad(self.rectify(self.expand(features)))
        narrow = self.project(self.rectify(self.depthwise(wide)))
        return narrow + features if self.shortcut else narrow


class InvertedResidualNetwork(ImageNetwork):
    """
    A convolution with 32 kernels of 3x3 pixels and stride 2, and inverted residual blocks.

    In training a normalization of the batch followed every convolution; it is folded into them.
    Images are extended instead of the padding of the first convolution, with their border
    instead of zeros.

    Attributes
    ----------
    plan : mapping of str to Block
        The blocks, as `blocks` returns them; the layers follow from them.
    epsilon : float
        What the normalizations add to a variance.

    """

    input_channels = 1
    margin = 1
    plan: ClassVar[Mapping[str, Block]]
    epsilon: ClassVar[float]

    def __init_subclass__(cls) -> None:
        """Find out where the cells of each layer lie."""
        super().__init_subclass__()
        cls.layers = _layers(cls.plan)

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = Conv2d(1, _STEM_CHANNELS, 3, stride=_STEM_STRIDE)
        stages: dict[str, tuple[Module, ...]] = {'conv1': (self.conv1, ReLU6())}
        for name, plan in self.plan.items():
            block = InvertedResidual(plan)
            self.add_module(name, block)
            stages[name] = (block,)
        self.stages = stages

    @classmethod
    def published(cls) -> dict[str, tuple[str, str]]:
        """Return the convolution and the normalization of a published file for each of ours."""
        raise NotImplementedError

    @classmethod
    def file_shapes(cls) -> dict[str, tuple[int, ...]]:
        """Return the name and the shape of each array, with normalizations in place of biases."""
        shapes = {}
        for name, shape in super().file_shapes().items():
            layer, _, part = name.rpartition('.')
            names = ([f'{layer}.norm.{each}' for each in _NORMALIZATION] if part == 'bias'
                     else [name])
            shapes.update(dict.fromkeys(names, shape))
        return shapes

    @classmethod
    def own_names(cls, arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the arrays of a published file, or of ours, under the names of `file_shapes`."""
        ours = {}
        for name, (convolution, normalization) in cls.published().items():
            ours[f'{convolution}.weight'] = f'{name}.weight'
            ours.update({f'{normalization}.{part}': f'{name}.norm.{part}'
                         for part in _NORMALIZATION})
        return super().own_names({ours.get(name, name): array for name, array in arrays.items()})

    @classmethod
    def _state(cls, arrays: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        """Return the state with the normalizations folded into the convolutions before them."""
        state = {'mean': arrays['mean']}
        for name in cls.published():
            weight, bias = fold_normalization(
                arrays[f'{name}.weight'],
                [arrays[f'{name}.norm.{part}'] for part in _NORMALIZATION], cls.epsilon)
            state[f'{name}.weight'], state[f'{name}.bias'] = weight, bias
        return super()._state(state)


def _layers(plan: Mapping[str, Block]) -> dict[str, Layer]:
    """Return the layers of a network, from the geometry of its blocks."""
    stride, middle = _STEM_STRIDE, _STEM_MIDDLE
    found = {'conv1': Layer(stride, _STEM_CHANNELS, middle - stride / 2)}
    for name, block in plan.items():
        middle += stride * ((block.kernel - 1) / 2 - block.before)
        stride *= block.stride
        found[name] = Layer(stride, block.channels, middle - stride / 2)
    return found
