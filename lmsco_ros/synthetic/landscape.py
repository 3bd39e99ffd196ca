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

"""The still part of the scene: sky, hills, ground and things that are warm by themselves."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

# Counts of an uncooled 16-bit core that looks at an evening scene.
SKY, HILLS, GROUND = 7150.0, 7420.0, 7560.0
CLUTTER_HEAT = (7680.0, 7900.0)
HORIZON = 0.42


def render_landscape(width: int, height: int, clutter: int,
                     rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """
    Return the counts of a panorama without the moving things.

    Parameters
    ----------
    width, height : int
        Size of the panorama, in pixels.
    clutter : int
        Number of warm things that stand around.
    rng : numpy.random.Generator
        Decides everything that is accidental.

    Returns
    -------
    ndarray, shape (height, width), float32

    """
    rows = np.linspace(0, 1, height, dtype=np.float32)[:, None]
    columns = np.arange(width)
    skyline = HORIZON - 0.10 * (0.5 + 0.5 * _texture((1, width), 0.35 * height, rng)[0])
    treeline = HORIZON - 0.025 * (1 + np.abs(_texture((1, width), 0.03 * height, rng)[0]))
    scene = SKY + 160 * rows + 14 * _texture((height, width), 0.25 * height, rng)
    hills = HILLS + 60 * (rows - HORIZON) + 10 * _texture((height, width), 0.06 * height, rng)
    trees = HILLS + 55 + 18 * _texture((height, width), 0.015 * height, rng)
    ground = (GROUND + 90 * (rows - HORIZON)
              + 22 * _texture((height, width), 0.10 * height, rng, stretch=3)
              + 12 * _texture((height, width), 0.012 * height, rng, stretch=2))
    scene = np.where(rows > skyline[columns], hills, scene)
    scene = np.where(rows > treeline[columns], trees, scene)
    scene = np.where(rows > HORIZON, ground, scene).astype(np.float32)
    surface = 12 * _texture((height, width), 0.02 * height, rng)
    for _ in range(clutter):
        _place_clutter(scene, surface, rng)
    return np.asarray(cv2.GaussianBlur(scene, (0, 0), 0.7), np.float32)


def _place_clutter(scene: npt.NDArray[np.float32], surface: npt.NDArray[np.float32],
                   rng: np.random.Generator) -> None:
    """Put one warm stone or sunlit bush somewhere on the ground."""
    height, width = scene.shape
    depth = rng.uniform(0.02, 1)
    size = 0.035 * height * (0.25 + depth)
    center = (int(rng.uniform(0, width)), int(height * (HORIZON + 0.5 * depth)))
    axes = (max(1, int(size * rng.uniform(0.4, 1.2))), max(1, int(size * rng.uniform(0.3, 0.9))))
    shape = np.zeros(scene.shape, np.uint8)
    cv2.ellipse(shape, center, axes, rng.uniform(-20, 20), 0, 360, 1, cv2.FILLED)
    np.copyto(scene, surface + np.float32(rng.uniform(*CLUTTER_HEAT)), where=shape > 0)


def _texture(shape: tuple[int, int], grain: float, rng: np.random.Generator,
             stretch: float = 1.0) -> npt.NDArray[np.float32]:
    """Return smooth noise of unit strength: four octaves, the coarsest `grain` pixels."""
    total = np.zeros(shape, np.float32)
    for octave in range(4):
        cell = max(1.0, grain / 2 ** octave)
        coarse = (max(1, round(shape[0] / cell)) + 1, max(2, round(shape[1] / cell / stretch)) + 1)
        values = rng.standard_normal(coarse, dtype=np.float32)
        total += 0.5 ** octave * cv2.resize(values, shape[::-1], interpolation=cv2.INTER_CUBIC)
    return total
