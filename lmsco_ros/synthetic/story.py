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
A thermal scene in which the target meets a twin, is lost and comes back; with exact ground truth.

A person walks across open ground and comes nearer. A twin, as warm and nearly as tall, passes by.
A truck stops in front of the person for some seconds, and drives on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import math

import cv2
import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from lmsco_ros.synthetic.figures import bounds, Capsule, Clothes, Layer, rasterize, walker
from lmsco_ros.synthetic.landscape import HORIZON, render_landscape
from lmsco_ros.synthetic.scene import SceneConfig, SceneFrame
from lmsco_ros.synthetic.sensor import Sensor
from lmsco_ros.synthetic.stage import compose, look

# Of the whole plot, in seconds; a scene of another length is played faster or slower.
DURATION = 30.0
# A face is warm; a coat shows less of the warmth below it.
_CLOTHES = Clothes(head=1.0, torso=0.987, arms=0.991, legs=0.982)
_HEAT = 7900.0
_STEPS_PER_SECOND = 1.8
_PANORAMA = 2.05

# Moments in seconds, and places along the panorama in widths of a frame.
_TARGET = ((0, 0.25), (30, 1.75))
_TWIN = ((0, 1.1), (8, 0.65), (30, -0.6))
_CAMERA = ((0, 0.0), (4, 0.05), (16, 0.58), (22, 0.68), (30, 1.03))
_NEARNESS = ((0, 0.75), (10, 1.1), (21, 1.1), (30, 0.8))
_DRIVE = ((0, 2.4), (14, 2.0), (15.2, 1.6), (17, 1.03), (18.6, 1.01), (22.5, -0.3), (30, -3.0))
# Of the truck: its length in widths of a frame; of its parts the corners, in shares of length and
# height, and the counts: chassis, trailer, cab, window, engine; where its wheels are.
_LENGTH, _BOARDS = 0.55, 7330.0
_PARTS = (
    (((0.02, 0.7), (0.98, 0.93)), 7400.0), (((0.23, 0.0), (1.0, 0.86)), _BOARDS),
    (((0.0, 0.24), (0.24, 0.9)), 7420.0), (((0.02, 0.32), (0.12, 0.54)), 7300.0),
    (((0.0, 0.66), (0.1, 0.86)), 7840.0))
_WHEELS = (0.1, 0.2, 0.78, 0.86, 0.94)
_MARGIN = 3


def render_story(config: SceneConfig) -> Iterator[SceneFrame]:
    """Yield the frames of the story, stretched over the length that `config` has."""
    rng = np.random.default_rng(config.seed)
    shape = (config.height, config.width)
    wide = (config.height + 16, round(_PANORAMA * config.width))
    panorama = render_landscape(wide[1], wide[0], config.clutter, rng)
    truck = _Truck(config, rng)
    sensor = Sensor(shape, config.noise, config.pattern, rng)
    target, twin, drive, camera, nearness = map(
        _course, (_TARGET, _TWIN, _DRIVE, _CAMERA, _NEARNESS))
    for index in range(config.frames):
        moment = DURATION * index / max(1, config.frames - 1)
        time = index / config.fps
        pan = (camera(moment) * config.width, 8 + 4 * math.sin(2 * math.pi * moment / 20))
        tall = nearness(moment) * config.target_height * config.height
        person = _person(config, target(moment), tall, time, pan)
        other = _person(config, twin(moment), 0.9 * tall, 1.05 * time + 0.3, pan)
        scene = look(panorama, pan, shape)
        visible = compose(scene, person, [rasterize(other, shape)],
                          [truck.at(drive(moment) * config.width, pan)])
        yield SceneFrame(index, round(1e9 * time), sensor.expose(scene, time), bounds(person),
                         visible)


def _course(points: Sequence[tuple[float, float]]) -> Callable[[float], float]:
    """Return a smooth way through (moment, value) that never overshoots."""
    moments, values = zip(*points)
    way = PchipInterpolator(moments, values)
    return lambda moment: float(way(moment))


def _person(config: SceneConfig, along: float, tall: float, time: float,
            pan: tuple[float, float]) -> tuple[Capsule, ...]:
    """Return somebody at a place of the panorama, in image pixels."""
    # Feet are lower in the picture the nearer, so the taller, somebody is.
    ground = (HORIZON + 1 / 64) * config.height + 1.25 * tall
    foot = (along * config.width - pan[0], ground - pan[1])
    phase = math.pi * (_STEPS_PER_SECOND * time + 0.25)
    return walker(foot, tall, phase, _HEAT, _CLOTHES)


class _Truck:
    """
    A truck with a trailer, seen from the side, that hides who is behind it.

    Parameters
    ----------
    config : SceneConfig
        Size of the scene.
    rng : numpy.random.Generator
        Decides how evenly warm its boards are.

    """

    def __init__(self, config: SceneConfig, rng: np.random.Generator) -> None:
        unit = config.target_height * config.height
        length, tall = _LENGTH * config.width, 1.9 * unit
        shape = (round(tall) + 2 * _MARGIN, round(length) + 2 * _MARGIN)
        # Around it as warm as it is, or its edges would be drawn cold.
        heat, cover = np.full(shape, _BOARDS, np.float32), np.zeros(shape, np.float32)
        boards = np.repeat(rng.normal(0, 6, -(-shape[1] // 6)), 6)[:shape[1]]
        for part, counts in _PARTS:
            low, high = (np.array(corner) * (length, tall) + _MARGIN for corner in part)
            corners = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
            _fill(heat, counts, corners)
            _fill(cover, 1.0, corners)
        heat += boards.astype(np.float32)
        for along in _WHEELS:
            hub = (round(along * length) + _MARGIN, round(0.91 * tall) + _MARGIN)
            for radius, counts in ((0.09, 7640.0), (0.05, 7790.0)):
                cv2.circle(heat, hub, max(1, round(radius * tall)), counts, cv2.FILLED)
            cv2.circle(cover, hub, max(1, round(0.09 * tall)), 1.0, cv2.FILLED)
        self._heat = np.asarray(cv2.GaussianBlur(heat, (0, 0), 0.7), np.float32)
        self._cover = np.asarray(cv2.GaussianBlur(cover, (0, 0), 0.5), np.float32)
        self._top = HORIZON * config.height + 1.6 * unit - tall - _MARGIN
        self._shape = (config.height, config.width)

    def at(self, left: float, pan: tuple[float, float]) -> Layer:
        """Return the truck with its front at a place of the panorama, in pixels."""
        corner = (pan[0] - left + _MARGIN, pan[1] - self._top)
        return Layer(slice(0, self._shape[0]), slice(0, self._shape[1]),
                     look(self._cover, corner, self._shape),
                     look(self._heat, corner, self._shape))


def _fill(picture: npt.NDArray[np.float32], value: float,
          corners: Sequence[tuple[float, float]]) -> None:
    """Fill a convex polygon of the picture with a value."""
    points = np.round(np.array(corners)).astype(np.int32)
    cv2.fillConvexPoly(picture, points, value)
