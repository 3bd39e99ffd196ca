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
A thermal scene with a plot and exact ground truth.

A person walks across open ground, comes nearer and goes away again, while the camera
pans slowly after them. Another person crosses behind; later the first one passes behind
a post. Warm stones and bushes stand around.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import math

import numpy as np
import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.synthetic.figures import bounds, Capsule, rasterize, walker
from lmsco_ros.synthetic.landscape import HORIZON, render_landscape
from lmsco_ros.synthetic.sensor import Sensor
from lmsco_ros.synthetic.stage import compose, look

_TARGET_HEAT, _DISTRACTOR_HEAT, _POST_HEAT = 7880.0, 7850.0, 7610.0
_CROSSING, _HIDING = 0.35, 0.64
_STEPS_PER_SECOND = 1.8
_PANORAMA = 1.7


@dataclass(frozen=True)
class SceneConfig:
    """
    Everything that decides a scene; equal configs render equal frames.

    Attributes
    ----------
    width, height : int
        Size of a frame, in pixels.
    frames : int
        Length; the plot is stretched over it.
    fps : float
        Frames per second, for stamps and steps.
    seed : int
        Decides landscape, clutter and noise.
    target_height : float
        Mean height of the target, as a share of the frame's.
    clutter : int
        Number of warm things that stand around.
    noise, pattern : float
        Standard deviation of the noise over time and of the fixed pattern, in counts.

    """

    width: int = 640
    height: int = 512
    frames: int = 450
    fps: float = 30.0
    seed: int = 1
    target_height: float = 0.2
    clutter: int = 40
    noise: float = 5.0
    pattern: float = 4.0

    def __post_init__(self) -> None:
        """Refuse what cannot be rendered."""
        if min(self.width, self.height) < 32:
            raise ValueError(f'a scene of {self.width}x{self.height} pixels is too small; '
                             'give at least 32x32')
        if self.frames < 1 or self.fps <= 0:
            raise ValueError(f'{self.frames} frames at {self.fps} frames per second make no '
                             'scene; give positive numbers')
        if not 0.05 <= self.target_height <= 0.6:
            raise ValueError(f'target_height is {self.target_height}; give a share of the '
                             'frame height from 0.05 to 0.6')


@dataclass(frozen=True)
class SceneFrame:
    """
    One frame with its truth.

    Attributes
    ----------
    index : int
        Number of the frame, from 0.
    stamp_ns : int
        Time since the first frame, in nanoseconds.
    image : ndarray, shape (H, W), uint16
        Raw sensor counts.
    box : BoundingBox
        The target's extent, hidden parts included; it may exceed the frame.
    visible : float
        Share of the target's area that is neither hidden nor outside, in [0, 1].

    """

    index: int
    stamp_ns: int
    image: npt.NDArray[np.uint16]
    box: BoundingBox
    visible: float


def render_scene(config: SceneConfig) -> Iterator[SceneFrame]:
    """Yield the frames of the scene that `config` describes."""
    rng = np.random.default_rng(config.seed)
    panorama = render_landscape(round(_PANORAMA * config.width), config.height + 16,
                                config.clutter, rng)
    sensor = Sensor((config.height, config.width), config.noise, config.pattern, rng)
    for index in range(config.frames):
        progress = index / max(1, config.frames - 1)
        time = index / config.fps
        pan = _pan(config, progress)
        scene = look(panorama, pan, (config.height, config.width))
        cast = _cast(config, progress, time, pan)
        behind, before = ([rasterize(body, scene.shape) for body in bodies]
                          for bodies in (cast.behind, cast.before))
        visible = compose(scene, cast.target, behind, before)
        yield SceneFrame(index, round(1e9 * time), sensor.expose(scene, time),
                         bounds(cast.target), visible)


@dataclass(frozen=True)
class _Cast:
    """Who is in the picture, as capsules in image pixels."""

    target: tuple[Capsule, ...]
    behind: tuple[tuple[Capsule, ...], ...]
    before: tuple[tuple[Capsule, ...], ...]


def _ease(progress: float) -> float:
    """Go from 0 to 1 with a soft start and stop."""
    return progress * progress * (3 - 2 * progress)


def _pan(config: SceneConfig, progress: float) -> tuple[float, float]:
    """Return the upper left corner of the view in the panorama, in pixels."""
    along = (_PANORAMA - 1) * config.width * _ease(progress)
    return along, 8 + 4 * math.sin(2 * math.pi * progress * 1.5)


def _target_place(config: SceneConfig, progress: float) -> tuple[float, float]:
    """Return where the target is along the panorama and how tall, in pixels."""
    along = config.width * (0.2 + (_PANORAMA - 0.5) * progress
                            + 0.03 * math.sin(2 * math.pi * progress))
    nearness = 0.7 + 0.7 * math.sin(math.pi * progress) ** 2
    return along, nearness * config.target_height * config.height


def _cast(config: SceneConfig, progress: float, time: float,
          pan: tuple[float, float]) -> _Cast:
    """Place everybody for one moment of the plot."""
    def stand(along: float, tall: float) -> tuple[float, float]:
        # Feet are lower in the picture the nearer, so the taller, somebody is.
        return along - pan[0], HORIZON * config.height + 1.25 * tall + 8 - pan[1]

    phase = math.pi * (_STEPS_PER_SECOND * time + 0.25)
    along, tall = _target_place(config, progress)
    meeting, met_height = _target_place(config, _CROSSING)
    other = meeting - 1.1 * config.width * (progress - _CROSSING)
    hiding, _ = _target_place(config, _HIDING)
    reach = 1.6 * config.target_height * config.height
    foot = stand(hiding, reach)
    radius = 0.09 * config.target_height * config.height
    return _Cast(
        target=walker(stand(along, tall), tall, phase, _TARGET_HEAT),
        behind=(walker(stand(other, 0.85 * met_height), 0.85 * met_height, 1.1 * phase + 1,
                       _DISTRACTOR_HEAT),),
        before=((Capsule(*foot, foot[0], foot[1] - 2 * reach, radius, _POST_HEAT),),))
