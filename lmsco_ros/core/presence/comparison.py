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

"""Siamese comparison with the first frame: whether what the filter has found is the target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox

if TYPE_CHECKING:
    from lmsco_ros.core.networks.comparison import ComparisonNet

__all__ = ['Comparison']


class Comparison:
    """
    Compares what is in a box with the target of the first frame, which never changes.

    Parameters
    ----------
    network : ComparisonNet
        Compares two patches.
    view : FrameView
        First frame.
    box : BoundingBox
        The target in it.

    """

    def __init__(self, network: ComparisonNet, view: FrameView, box: BoundingBox) -> None:
        self._network = network
        self._reference = network.reference(self._encode(view, box))

    def __call__(self, view: FrameView, box: BoundingBox) -> float:
        """Return the log-odds that a box shows the target of the first frame."""
        return self._network.relate(self._reference, self._encode(view, box))

    def _encode(self, view: FrameView, box: BoundingBox) -> object:
        """Return the encoding of the region around a box."""
        context, size = self._network.context, self._network.size
        region = BoundingBox.from_center(
            box.center, (context * box.width, context * box.height))
        return self._network.encode(view.patch(region, (size, size)))
