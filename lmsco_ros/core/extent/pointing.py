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

"""The extent of what is at a point, of which nothing else is known."""

from __future__ import annotations

from collections.abc import Sequence
import reprlib
from typing import TYPE_CHECKING

from lmsco_ros.core.errors import PointError
from lmsco_ros.core.extent.measurement import ExtentMeter, Measurement
from lmsco_ros.core.imaging.regions import visible_part
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.types import BoundingBox

if TYPE_CHECKING:
    from lmsco_ros.core.networks.extent import ExtentNet

__all__ = ['extent_at']

_SMALLEST, _RATIO, _LARGEST_PART = 8.0, 2**0.5, 0.7
_ROUNDS = 3
# Log-odds that a deviation as large as the target itself takes away.
_DOUBT = 10.0
_LEAST_WORTH = 0.0


def extent_at(network: ExtentNet, view: FrameView, point: Sequence[float]) -> BoundingBox:
    """
    Return the box of what stands out from its surroundings at a point.

    Squares of growing size around the point are measured, each anew from what was measured; of
    what holds the point, the most present and surest is taken.

    Parameters
    ----------
    network : ExtentNet
        Measures.
    view : FrameView
        The frame.
    point : sequence of float
        Image position (x, y) in pixels.

    Raises
    ------
    PointError
        When the point is not in the image, or nothing stands out there.

    """
    place = _checked(point, view.size)
    meter = ExtentMeter.unmarked(network)
    found = [measured for side in _sides(view) if (
        measured := _settled(meter, view, BoundingBox.from_center(place, (side, side)))
    ).box.contains(place)]
    best = max(found, key=_worth, default=None)
    if best is None or _worth(best) < _LEAST_WORTH:
        raise PointError(f'nothing stands out from its surroundings at {place}; expected a '
                         'target that is warmer or colder: point at its middle, or give its box')
    return visible_part(best.box, view.size)


def _checked(point: object, image_size: tuple[int, int]) -> tuple[float, float]:
    """Return a point (x, y) in the image."""
    try:
        x, y = (float(value) for value in point)  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        raise PointError(f'the point {reprlib.repr(point)} is a {type(point).__name__}; expected '
                         '(x, y): two numbers in pixels') from None
    width, height = image_size
    if not (0 <= x <= width and 0 <= y <= height):
        raise PointError(f'the point ({x:g}, {y:g}) is not in the image of {width} x {height} '
                         'pixels; give (x, y) in pixels of this image')
    return x, y


def _sides(view: FrameView) -> list[float]:
    """Return the sides of the squares that are tried."""
    sides = [_SMALLEST]
    while sides[-1] * _RATIO <= _LARGEST_PART * max(view.size):
        sides.append(sides[-1] * _RATIO)
    return sides


def _settled(meter: ExtentMeter, view: FrameView, box: BoundingBox) -> Measurement:
    """
    Return what is measured around a square, and around what was measured there, and so on.

    Around squares, since the network knows only these of what was never marked.
    """
    measured = meter(view, box)
    for _ in range(_ROUNDS):
        side = measured.box.area**0.5
        measured = meter(view, BoundingBox.from_center(measured.box.center, (side, side)))
    return measured


def _worth(measured: Measurement) -> float:
    """Return how much speaks for a measurement."""
    relative = float(measured.deviations.mean()) / measured.box.area**0.5
    return measured.presence - _DOUBT * relative
