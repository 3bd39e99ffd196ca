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

"""How much of a measured size is believed, and how much of it is told."""

from __future__ import annotations

import math

from lmsco_ros.core.types import BoundingBox

__all__ = ['credible_change', 'steady']


def credible_change(factor: float, box: BoundingBox, damping: float) -> float:
    """
    Return the part of a measured change of size that is believed.

    The error of the measurement is about the same part of a pixel for all targets, so relative to
    the size it grows as that shrinks; changes from one frame to the next are relative. The best
    linear estimate (Wiener) takes the share s^2 / (s^2 + damping^2) of the logarithm.

    Parameters
    ----------
    factor : float
        Measured size over the last one.
    box : BoundingBox
        Target in the last size; s is the side of a square of its area, in pixels.
    damping : float
        Side in pixels of a target of whose measured change one half is believed.

    """
    return factor**(box.area / (box.area + damping**2))


def steady(box: BoundingBox, first: tuple[float, float], tolerance: float) -> BoundingBox:
    """
    Return a box without the change of size that is less than what can be measured.

    The size of a target is known to a part of a pixel at best, which is much of a small one:
    what is measured is the most probable size under Gaussian noise, and a Laplace prior around
    the size in the first frame, at a soft threshold.

    Parameters
    ----------
    box : BoundingBox
        Target in the size that was measured.
    first : tuple of float
        Size of the target (width, height) in the first frame.
    tolerance : float
        Threshold in pixels, of the side of a square of the first size.

    """
    change = 0.5 * math.log(box.area / (first[0] * first[1]))
    threshold = tolerance / math.sqrt(first[0] * first[1])
    beyond = max(0.0, abs(change) - threshold)
    return box.scaled(math.exp(math.copysign(beyond, change) - change))
