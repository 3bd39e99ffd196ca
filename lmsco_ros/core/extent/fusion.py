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
Fusion of what is measured of a target's extent with what was expected, by their variances.

Along each axis, the state is the two edges of the target; a Kalman filter whose prediction is the
last size around the place that the correlation filter has found, and whose measurement is that of
the network.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.imaging.regions import at_border
from lmsco_ros.core.types import BoundingBox

__all__ = ['EdgeFilter', 'place_to_learn']

_Array = npt.NDArray[np.float64]

# In sides of the target: the error of a box that a person draws, and that of the correlation
# filter's center.
_DRAWN, _FOUND = 0.08, 0.2
# The change of a side from one frame to the next, and what comes to it while a border of the image
# cuts the target.
_CHANGE, _CHANGE_AT_BORDER = 0.05, 0.15
_DRAWN_PIXELS = 0.7
# By how much an edge differs from the expectation, and not as the other one does, without telling
# of a change. In pixels: a person has drawn the first box after a convention of his own. In
# squared deviations over sides, where these are larger than those of an edge that is seen as
# sharply as pixels allow: it is not clear what belongs to the target, a neighbor that touches it
# or what it wears, and a box that followed would be taken for the target next, and grow on.
_CONVENTION, _UNCLEAR, _SHARP_PIXELS = 0.3, 12.0, 2.0
# Frames in which the whole of a target that came in over the border shows how large it is, and how
# that is drawn.
_SETTLING = 100
_SMALLEST_SIDE = 2.0
# Deviation of the measured edges, in sides of the target, with which the filter learns half of the
# way from its own center to the fused one: all of it would lead it away with a neighbor that was
# measured by mistake, nothing would leave it on the part of the target that came into view first.
_ANCHORING = 0.2


class EdgeFilter:
    """
    The size of a target, and how sure it is.

    Parameters
    ----------
    box : BoundingBox
        The target in the first frame.
    image_size : tuple of int
        Width and height of the image in pixels.

    """

    def __init__(self, box: BoundingBox, image_size: tuple[int, int]) -> None:
        self._image_size = image_size
        # A box that the border cuts says nothing of what will be drawn around the whole.
        self._whole = 0 if any(map(any, at_border(box, image_size))) else _SETTLING
        error = (_DRAWN * _side(box))**2 + _DRAWN_PIXELS**2
        self._covariances = np.tile(np.diag([error, error]), (2, 1, 1))

    @property
    def settled(self) -> bool:
        """Whether the whole of the target was in view for long enough, or in the first frame."""
        return self._whole >= _SETTLING

    def __call__(self, box: BoundingBox, measured: Measurement) -> BoundingBox:
        """
        Return the box of the target.

        Parameters
        ----------
        box : BoundingBox
            In the size of the last frame, around the place that the filter has found.
        measured : Measurement
            Of the network.

        """
        edges, side = _edges(box), _side(box)
        cut = self._cut(box) | self._cut(measured.box)
        settled = min(1.0, self._whole / _SETTLING)
        open_to_change = np.where(cut, 1.0, 1 - settled)
        found = (1 + open_to_change) * (_FOUND * side)**2
        change = ((_CHANGE_AT_BORDER * open_to_change)**2 + _CHANGE**2) * side**2
        size = _size_variance(self._covariances) + change
        predicted = _predicted(found, size)
        self._whole += not cut.any()
        noise = measured.deviations**2
        unclear = np.maximum(0.0, noise - _SHARP_PIXELS**2) / side
        spared = settled * (_CONVENTION + _UNCLEAR * unclear)
        moved = measured.edges - edges
        told = _shared(moved) + _beyond(moved - _shared(moved), spared)
        gain = predicted @ np.linalg.inv(predicted + noise[:, :, None] * np.eye(2))
        fused = edges + (gain @ told[:, :, None])[:, :, 0]
        self._covariances = predicted - gain @ predicted
        return _box(fused)

    def _cut(self, box: BoundingBox) -> npt.NDArray[np.bool_]:
        """Return along which axes the border of the image cuts a box."""
        return np.array([any(ends) for ends in at_border(box, self._image_size)])


def place_to_learn(found: tuple[float, float], fused: BoundingBox,
                   measured: Measurement | None) -> tuple[float, float]:
    """
    Return the place (x, y) that the correlation filter should learn.

    Parameters
    ----------
    found : tuple of float
        Where (x, y) it has found the target, in pixels.
    fused : BoundingBox
        The target, with what was measured.
    measured : Measurement or None
        Of the network: the surer it is, the nearer is the place to the fused center.

    """
    if measured is None:
        return found
    unsure = measured.deviations.mean(axis=1) / _side(fused)
    x, y = np.array(found) + (np.array(fused.center) - found) / (1 + (unsure / _ANCHORING)**2)
    return float(x), float(y)


def _shared(moved: _Array) -> _Array:
    """Return how far both edges along an axis have moved to the same side, shape (2, 1)."""
    low, high = moved.min(axis=1, keepdims=True), moved.max(axis=1, keepdims=True)
    return np.maximum(low, 0.0) + np.minimum(high, 0.0)


def _beyond(difference: _Array, spared: _Array) -> _Array:
    """Return what is left of a difference when so much of it is taken away."""
    return np.sign(difference) * np.maximum(0.0, np.abs(difference) - spared)


def _size_variance(covariances: _Array) -> _Array:
    """Return the variances of the distance of two edges, from covariances (2, 2, 2) of both."""
    return covariances[:, 0, 0] + covariances[:, 1, 1] - 2 * covariances[:, 0, 1]


def _predicted(center: _Array, size: _Array) -> _Array:
    """Return covariances (2, 2, 2) of two edges, from variances of center and size along axes."""
    same, opposite = np.ones((2, 2)), np.array([[1, -1], [-1, 1]])
    return center[:, None, None] * same + size[:, None, None] / 4 * opposite


def _edges(box: BoundingBox) -> _Array:
    """Return left and right, upper and lower edge, shape (2, 2)."""
    return np.array([[box.x, box.x + box.width], [box.y, box.y + box.height]])


def _box(edges: _Array) -> BoundingBox:
    """Return the box of edges, with sides that can be tracked."""
    width, height = np.maximum(_SMALLEST_SIDE, edges[:, 1] - edges[:, 0]).tolist()
    x, y = edges.mean(axis=1).tolist()
    return BoundingBox.from_center((x, y), (width, height))


def _side(box: BoundingBox) -> float:
    """Return the side of a square as large as a box."""
    return float(box.area**0.5)
