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
NanoTrack whose head answers on another grid than OpenCV's own class expects.

`cv2.TrackerNano` reads 16 x 16 places; version 3 of the networks gives 15 x 15. The way from
their answers to a box is that of Siamese trackers without anchors: Li et al., "High
Performance Visual Tracking with Siamese Region Proposal Network" (2018) for the search
region, penalty and window; Xu et al., "SiamFC++" (2020) for distances to the four edges.
"""

from __future__ import annotations

from dataclasses import dataclass
import hashlib
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, TrackState
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.trackers.code_version import sources_digest
from lmsco_ros.evaluation.trackers.interface import Answer
from lmsco_ros.evaluation.trackers.opencv_image import EightBitView

NANO_V3_NAME = 'nanotrack_v3'

# Places along a side of the answer that `cv2.TrackerNano` reads.
OPENCV_SIDE = 16

# Pixels of the patches that the networks take, and between places of their answer.
_TEMPLATE, _SEARCH, _STRIDE = 127, 255, 16
# Share of the mean side of the target that is added around it.
_CONTEXT = 0.5
_PENALTY, _WINDOW, _RATE = 0.138, 0.455, 0.348
_SMALLEST_SIDE = 10.0
_ROUNDED_DOWN = 0.5


class _Networks:
    """
    Backbone and head.

    Parameters
    ----------
    backbone, head : Path
        ONNX files; the head takes `input1` (template) and `input2` (search region).

    Raises
    ------
    cv2.error
        When OpenCV cannot read them.

    """

    def __init__(self, backbone: Path, head: Path) -> None:
        self._backbone = cv2.dnn.readNet(str(backbone))
        self._head = cv2.dnn.readNet(str(head))

    def features(self, patch: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        """Return the features of a patch, shape (side, side, 3)."""
        self._backbone.setInput(cv2.dnn.blobFromImage(patch))
        return self._backbone.forward().copy()

    def answer(self, template: npt.NDArray[np.float32],
               search: npt.NDArray[np.float32]) -> tuple[Array, Array]:
        """
        Compare features.

        Returns
        -------
        scores : ndarray, shape (side, side)
            Probability of the target at each place.
        distances : ndarray, shape (4, side, side)
            From each place to the left, upper, right and lower edge, in pixels.

        """
        self._head.setInput(template, 'input1')
        self._head.setInput(search, 'input2')
        classes, distances = (np.asarray(blob[0], dtype=float)
                              for blob in self._head.forward(['output1', 'output2']))
        return 1 / (1 + np.exp(classes[0] - classes[1])), distances


class NanoTracker:
    """
    NanoTrack by `cv2.dnn` behind the interface of the evaluation.

    Parameters
    ----------
    backbone, head : Path
        ONNX files.

    Raises
    ------
    cv2.error
        When OpenCV cannot read them.

    """

    in_process = True

    def __init__(self, backbone: Path, head: Path) -> None:
        """Read the networks."""
        self._networks = _Networks(backbone, head)
        self._view: EightBitView | None = None
        self._template: npt.NDArray[np.float32] | None = None
        self._center = np.zeros(2)
        self._size = np.ones(2)

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start on `box`."""
        self._view = EightBitView(image)
        self._center, self._size = np.array(box.center), np.array(box.size)
        patch = _patch(self._view(image), self._center, _region_side(self._size), _TEMPLATE)
        self._template = self._networks.features(patch)

    def update(self, image: npt.NDArray) -> Answer:
        """Track into `image`."""
        assert self._view is not None and self._template is not None
        scale = _TEMPLATE / _region_side(self._size)
        patch = _patch(self._view(image), self._center, _SEARCH / scale, _SEARCH)
        scores, distances = self._networks.answer(self._template, self._networks.features(patch))
        edges = _edges(distances)
        penalty = _penalties(edges[2:] - edges[:2], self._size * scale)
        window = np.outer(*[np.hanning(len(scores))] * 2)
        ranked = penalty * scores * (1 - _WINDOW) + window * _WINDOW
        row, column = divmod(int(np.argmax(ranked)), len(ranked))
        low, high = edges[:2, row, column], edges[2:, row, column]
        rate = penalty[row, column] * scores[row, column] * _RATE
        self._move(self._center + (low + high) / 2 / scale,
                   self._size * (1 - rate) + (high - low) / scale * rate, image.shape)
        box = BoundingBox(*(self._center - self._size / 2).tolist(), *self._size.tolist())
        return Answer(box, float(scores[row, column]), TrackState.TRACKING)

    def close(self) -> None:
        """Release nothing; OpenCV counts references."""

    def _move(self, center: Array, size: Array, shape: tuple[int, ...]) -> None:
        """Go to a place and size, within the image."""
        limits = np.array([shape[1], shape[0]], dtype=float)
        self._center = np.clip(center, 0, limits)
        self._size = np.clip(size, _SMALLEST_SIDE, np.maximum(limits, _SMALLEST_SIDE))


@dataclass(frozen=True)
class NanoSpec:
    """
    NanoTrack by its files.

    Attributes
    ----------
    backbone, head : Path
        ONNX files.

    """

    backbone: Path
    head: Path

    @property
    def name(self) -> str:
        """Name in tables."""
        return NANO_V3_NAME

    @property
    def identity(self) -> str:
        """Version of OpenCV, digests of this module and of the model files."""
        digests = [hashlib.sha256(path.read_bytes()).hexdigest()
                   for path in (self.backbone, self.head)]
        return ' '.join([f'opencv {cv2.__version__}', sources_digest((Path(__file__),)), *digests])

    def build(self) -> NanoTracker:
        """Return the tracker, or raise `TrackerError` where OpenCV cannot read its files."""
        try:
            return NanoTracker(self.backbone, self.head)
        except cv2.error as error:
            raise TrackerError(f'tracker {self.name!r}: OpenCV cannot use the model files '
                               f'{self.backbone}, {self.head}') from error


def answer_side(backbone: Path, head: Path) -> int | None:
    """Return the places along a side of the head's answer; None where there is no answer."""
    try:
        networks = _Networks(backbone, head)
        template, search = (networks.features(np.zeros((side, side, 3), np.uint8))
                            for side in (_TEMPLATE, _SEARCH))
        return len(networks.answer(template, search)[0])
    except (cv2.error, ValueError, IndexError):
        return None


def _region_side(size: Array) -> float:
    """Return the side of the square around a target and its context, in pixels."""
    return float(np.sqrt(np.prod(size + _CONTEXT * size.sum())))


def _patch(view: npt.NDArray[np.uint8], center: Array, side: float,
           pixels: int) -> npt.NDArray[np.uint8]:
    """Return a square of the image as a patch; beyond the image it has the mean color."""
    scale = pixels / side
    # Pixel (0, 0) covers [0, 1), so its middle is at one half in the image and in the patch.
    # The networks know patches that begin at a pixel before that, rounded down: half a pixel
    # up and left of what would be right.
    shift = pixels / 2 - 0.5 - scale * (center - 0.5 - _ROUNDED_DOWN)
    transform = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    patch = cv2.warpAffine(view, transform, (pixels, pixels), flags=cv2.INTER_LINEAR,
                           borderMode=cv2.BORDER_CONSTANT, borderValue=cv2.mean(view))
    return np.asarray(patch, dtype=np.uint8)


def _edges(distances: Array) -> Array:
    """Return left, upper, right and lower edges, seen from the middle of the patch."""
    side = distances.shape[-1]
    steps = (np.arange(side) - side // 2) * float(_STRIDE)
    x, y = np.meshgrid(steps, steps)
    return np.stack([x - distances[0], y - distances[1], x + distances[2], y + distances[3]])


def _penalties(sizes: Array, size: Array) -> Array:
    """
    Return what is left of a score after a change of size and of shape.

    Parameters
    ----------
    sizes : ndarray, shape (2, side, side)
        Width and height at each place.
    size : ndarray, shape (2,)
        Width and height until now.

    """
    def change(ratio: Array) -> Array:
        return np.maximum(ratio, 1 / ratio)

    width, height = np.maximum(sizes, 1e-6)
    context = _CONTEXT * (width + height)
    sides = np.sqrt((width + context) * (height + context))
    changed = change(sides / _region_side(size)) * change((width / height) / (size[0] / size[1]))
    return np.exp(-(changed - 1) * _PENALTY)
