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

"""Registration of the target to its first frame: box and presence without drift."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

import numpy as np

from lmsco_ros.core.sampling import FrameView
from lmsco_ros.core.sections import RegistrationConfig
from lmsco_ros.core.types import BoundingBox

if TYPE_CHECKING:
    from lmsco_ros.core.backbones.registration import RegistrationNet

__all__ = ['Registered', 'Registration']


@dataclass(frozen=True)
class Registered:
    """
    What the comparison with the first frame says.

    Attributes
    ----------
    box : BoundingBox
        The target, in image pixels.
    presence : float
        Probability that the target of the first frame is there.

    """

    box: BoundingBox
    presence: float


class Registration:
    """
    Compares what is in a box with the target of the first frame.

    The first frame never changes, so that neither size nor aspect can run away; what the network
    finds in the first box itself is taken off all later answers.

    Parameters
    ----------
    config : RegistrationConfig
        How far to follow.
    network : RegistrationNet
        Compares two patches.
    view : FrameView
        First frame.
    box : BoundingBox
        The target in it.

    """

    def __init__(self, config: RegistrationConfig, network: RegistrationNet, view: FrameView,
                 box: BoundingBox) -> None:
        self._config = config
        self._network = network
        self._first = self._encode(view, box)
        self._bias = self._compare(view, box)[:4]

    def __call__(self, view: FrameView, box: BoundingBox) -> Registered:
        """
        Return the target near `box`.

        Parameters
        ----------
        view : FrameView
            A frame.
        box : BoundingBox
            Where the filter has seen the target, in the size of the last frame.

        """
        answer = self._compare(view, box)
        dx, dy, width, height = answer[:4] - self._bias
        center = (box.center[0] + self._config.center_rate * float(dx) * box.width,
                  box.center[1] + self._config.center_rate * float(dy) * box.height)
        found = BoundingBox.from_center(center, (
            box.width * self._factor(float(width)), box.height * self._factor(float(height))))
        return Registered(found, 1 / (1 + math.exp(-float(answer[4]))))

    def _factor(self, change: float) -> float:
        """Return the factor of a side, given the logarithm of the change that was seen."""
        excess = max(abs(change) - self._config.tolerance, 0.0)
        return math.exp(self._config.size_rate * math.copysign(excess, change))

    def _encode(self, view: FrameView, box: BoundingBox) -> object:
        """Return the encoding of the region around a box."""
        context, size = self._network.context, self._network.size
        region = BoundingBox.from_center(
            box.center, (context * box.width, context * box.height))
        return self._network.encode(view.patch(region, (size, size)))

    def _compare(self, view: FrameView, box: BoundingBox) -> np.ndarray:
        """Return what the network says of a box, shape (5,)."""
        return self._network.relate(self._first, self._encode(view, box))
