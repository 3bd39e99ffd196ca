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

"""Fusion of what was measured of a target's extent with what was expected, by variances."""

from __future__ import annotations

import os
import numpy as np

from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.types import BoundingBox

__all__ = ['ExtentFilter']
K_C=float(os.environ.get('K_C','.08'))
K_Q=float(os.environ.get('K_Q','.015'))
K_QB=float(os.environ.get('K_QB','.15'))
K_S=float(os.environ.get('K_S','1.5'))
K_T=float(os.environ.get('K_T','.5'))
K_H=float(os.environ.get('K_H','.08'))


class ExtentFilter:
    def __init__(self, box: BoundingBox, image_size) -> None:
        self._sides = np.array(box.size)
        side = box.area**.5
        self._variances = np.full(2, 2*(K_H * side)**2 + .5)
        self._limits = np.array(image_size, float)

    def __call__(self, box, center: tuple[float, float], measured: Measurement | None) -> BoundingBox:
        side = box.area**.5
        center = np.array(center)
        edges = center[:, None] + self._sides[:, None] * np.array([-.5, .5])
        q = np.full(2, (K_Q * side)**2)
        touch = (edges[:, 0] < 1) | (edges[:, 1] > self._limits - 1)
        if measured is not None:
            touch |= (measured.edges[:, 0] < 1.5) | (measured.edges[:, 1] > self._limits - 1.5)
        q[touch] += (K_QB * side)**2
        s = self._variances + q
        c = np.where(touch, 2, 1) * (K_C * side)**2
        if measured is None:
            self._variances = s
            return BoundingBox.from_center(tuple(center), tuple(self._sides))
        out = []
        for a in range(2):
            P = np.array([[c[a] + s[a]/4, c[a] - s[a]/4], [c[a] - s[a]/4, c[a] + s[a]/4]])
            dev = K_S * measured.deviations[a]
            innov = measured.edges[a] - edges[a]
            innov = np.sign(innov) * np.maximum(0, np.abs(innov) - K_T * dev)
            S = P + np.diag(dev**2)
            G = P @ np.linalg.inv(S)
            e = edges[a] + G @ innov
            P = P - G @ P
            self._sides[a] = max(2.0, e[1] - e[0])
            self._variances[a] = P[0,0]+P[1,1]-2*P[0,1]
            out.append((e[0]+e[1])/2)
        return BoundingBox.from_center(tuple(out), tuple(self._sides))
