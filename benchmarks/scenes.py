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

"""Frames to measure on: rendered, recorded, or scenes in which one thing can be varied."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
import math

import cv2
import numpy as np

from lmsco_ros.core import BoundingBox
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.session import Request, select_sequences
from lmsco_ros.synthetic import render_scene, SceneConfig
from lmsco_ros.synthetic.figures import bounds, Capsule, rasterize
from lmsco_ros.synthetic.landscape import render_landscape
from lmsco_ros.synthetic.sensor import Sensor

__all__ = ['Clip', 'moving_scene', 'paint', 'recorded_clips', 'walking_scene']

_PAN = 0.7
_DRIVE = 1.5
_HEAT = 7950.0


@dataclass(frozen=True)
class Clip:
    """
    A sequence in memory.

    Attributes
    ----------
    name : str
        For tables.
    frames : list of ndarray
        Images; the target is there in the first.
    truth : ndarray, shape (n, 4)
        True boxes, NaN where the target is absent.
    others : tuple of BoundingBox
        Further targets in the first frame.

    """

    name: str
    frames: list[np.ndarray]
    truth: np.ndarray
    others: tuple[BoundingBox, ...] = ()

    @property
    def start(self) -> BoundingBox:
        """Box of the target in the first frame."""
        return BoundingBox(*map(float, self.truth[0]))

    def endless(self, index: int) -> np.ndarray:
        """Return a frame of the clip played forth and back for ever."""
        last = len(self.frames) - 1
        return self.frames[last - abs(last - index % (2 * last))]


def walking_scene(count: int) -> Clip:
    """Return the first frames of a walk behind a post, 640x512."""
    scene = list(islice(render_scene(SceneConfig(frames=max(count, SceneConfig.frames))), count))
    return Clip('rendered scene', [frame.image for frame in scene],
                np.array([frame.box.as_tuple() for frame in scene]))


def recorded_clips(request: Request) -> Iterator[Clip]:
    """Yield the sequences of a request, each from the first frame that shows its target."""
    for sequence in select_sequences(request).sequences:
        start = int(np.argmin(is_absent(sequence.ground_truth)))
        if len(sequence) - start > 1:
            yield Clip(sequence.full_name,
                       [sequence.frames[index] for index in range(start, len(sequence))],
                       sequence.ground_truth[start:])


def moving_scene(size: tuple[int, int], target: float, count: int, seed: int = 1,
                 vehicles: int = 1) -> Clip:
    """
    Render vehicles that cross a landscape under a camera that pans the other way.

    Parameters
    ----------
    size : tuple of int
        Width and height of the frames.
    target : float
        Side of the vehicle's square box, in pixels.
    count : int
        Number of frames.
    seed : int
        Decides landscape and noise.
    vehicles : int
        How many there are: one in the middle, several in rows and columns.

    """
    width, height = size
    side = math.ceil(vehicles**0.5)
    places = [((column + 0.5) / side * width, (row + 0.5) / side * height)
              for row in range(side) for column in range(side)][:vehicles]
    rng = np.random.default_rng(seed)
    panorama = render_landscape(width + 16 + round(_PAN * count), height, 40, rng)
    sensor = Sensor((height, width), 5.0, 4.0, rng)
    frames, boxes = [], []
    for index in range(count):
        shift = np.array([[1, 0, _PAN * index], [0, 1, 0]], np.float64)
        scene = cv2.warpAffine(panorama, shift, size, borderMode=cv2.BORDER_REPLICATE,
                               flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        bodies = [_vehicle(x + _DRIVE * (index - count / 2), y, target) for x, y in places]
        for body in bodies:
            paint(scene, body)
        frames.append(sensor.expose(scene, index / 30))
        boxes.append([bounds(body) for body in bodies])
    return Clip(f'vehicle of {target:g} pixels', frames,
                np.array([first.as_tuple() for first, *_ in boxes]), tuple(boxes[0][1:]))


def paint(scene: np.ndarray, body: Sequence[Capsule]) -> None:
    """Draw a body over what is in a scene, float32 counts of shape (H, W)."""
    layer = rasterize(body, scene.shape)
    view = scene[layer.rows, layer.columns]
    view += layer.alpha * (layer.heat - view)


def _vehicle(x: float, y: float, side: float) -> tuple[Capsule, ...]:
    """Return a hull, a cabin and two warm wheels in a square around (x, y)."""
    def part(left: float, right: float, middle: float, radius: float, heat: float) -> Capsule:
        return Capsule(x + left * side, y + middle * side, x + right * side, y + middle * side,
                       radius * side, heat)

    return (part(-0.28, 0.28, 0.08, 0.22, _HEAT),
            part(-0.10, 0.16, -0.28, 0.22, 0.985 * _HEAT),
            part(-0.24, -0.24, 0.36, 0.14, 1.02 * _HEAT),
            part(0.24, 0.24, 0.36, 0.14, 1.02 * _HEAT))
