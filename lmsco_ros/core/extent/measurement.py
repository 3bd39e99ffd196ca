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

"""What a network measures of a target: its four edges, how sure they are, whether it is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

import numpy as np

from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import Ask, Asking, at_once
from lmsco_ros.core.types import BoundingBox

if TYPE_CHECKING:
    import torch

    from lmsco_ros.core.networks.extent import ExtentNet

__all__ = ['ExtentMeter', 'Measurement']

_SMALLEST_SIDE = 1.0


@dataclass(frozen=True)
class Measurement:
    """
    The extent of a target in one frame.

    Attributes
    ----------
    edges : ndarray, shape (2, 2)
        Left and right, upper and lower edge of what is seen of the target, in image pixels.
    deviations : ndarray, shape (2, 2)
        Standard deviations of their errors in pixels.
    presence : float
        Log-odds that the target of the first frame is there.

    """

    edges: np.ndarray
    deviations: np.ndarray
    presence: float

    @property
    def box(self) -> BoundingBox:
        """What is seen of the target."""
        (left, right), (top, bottom) = self.edges.tolist()
        return BoundingBox(left, top, right - left, bottom - top)


class ExtentMeter:
    """
    Measures targets like a known one, which never changes.

    Parameters
    ----------
    network : ExtentNet
        What measures.
    reference : tensor
        What the network knows of the target.
    side : float
        Binary logarithm of its side in pixels.

    """

    def __init__(self, network: ExtentNet, reference: torch.Tensor, side: float) -> None:
        self._network = network
        self._reference = reference
        self._first_side = side

    @classmethod
    def marked(cls, network: ExtentNet, view: FrameView, box: BoundingBox) -> ExtentMeter:
        """Return what measures targets like the one in a box of the first frame."""
        encoding = network.encode(_patch(network, view, box))
        return cls(network, network.reference(encoding), math.log2(_side(box)))

    @classmethod
    def unmarked(cls, network: ExtentNet) -> ExtentMeter:
        """Return what measures anything that stands out from its surroundings."""
        return cls(network, network.reference(network.nothing), 0.0)

    def __call__(self, view: FrameView, box: BoundingBox) -> Measurement:
        """
        Return the extent of the target.

        Parameters
        ----------
        view : FrameView
            A frame.
        box : BoundingBox
            Where the target is expected, and how large.

        """
        return at_once(self.ask(view, box))

    def ask(self, view: FrameView, box: BoundingBox) -> Asking[Measurement]:
        """Return the extent as `__call__` does, and ask the network for it."""
        network = self._network
        answer = yield Ask(id(network), network.answers, (
            _patch(network, view, box), self._reference,
            (self._first_side, math.log2(_side(box)))))
        unit = self._network.context * _side(box) / 2
        expected = np.array([[box.x, box.x + box.width], [box.y, box.y + box.height]])
        # The network speaks of left, top, right, bottom, and of Laplace distributions.
        edges = _apart(expected + unit * answer[:4].reshape(2, 2).T)
        deviations = math.sqrt(2) * unit * np.exp(answer[4:8].reshape(2, 2).T)
        return Measurement(edges, deviations, float(answer[8]))


def _patch(network: ExtentNet, view: FrameView, box: BoundingBox) -> np.ndarray:
    """Return what a network sees of a box, shape (3, size, size)."""
    size, side = network.size, network.context * _side(box)
    region = BoundingBox.from_center(box.center, (side, side))
    image = BoundingBox(0, 0, *view.size)
    return np.stack([view.patch(region, (size, size)), *_covered(region, (box, image), size)])


def _apart(edges: np.ndarray) -> np.ndarray:
    """Return edges in their order, and no nearer to each other than can be seen."""
    near, far = edges[:, :1], edges[:, 1:]
    half = np.maximum(np.abs(far - near), _SMALLEST_SIDE) / 2
    return (near + far) / 2 + half * (-1.0, 1.0)


def _side(box: BoundingBox) -> float:
    """Return the side of a square as large as a box, in pixels."""
    return math.sqrt(box.area)


def _covered(region: BoundingBox, boxes: Sequence[BoundingBox], size: int) -> np.ndarray:
    """Return how much of each pixel of a patch of a region boxes cover, shape (n, size, size)."""
    start, length = np.array([(region.y, region.x), (region.height, region.width)])
    lines = start + np.arange(size + 1)[:, None] * (length / size)
    low = np.array([(box.y, box.x) for box in boxes])[:, None]
    high = np.array([(box.y + box.height, box.x + box.width) for box in boxes])[:, None]
    inside = np.minimum(np.maximum(lines, low), high)
    spans = (inside[:, 1:] - inside[:, :-1]) * (size / length)
    return (spans[:, :, None, 0] * spans[:, None, :, 1]).astype(np.float32)
