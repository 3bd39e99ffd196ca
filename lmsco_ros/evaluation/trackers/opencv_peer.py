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
OpenCV's trackers as peers.

MIL, NanoTrack and VitTrack are part of every OpenCV; CSRT, KCF, MOSSE and MedianFlow need
its contrib build (extra `peers`). NanoTrack and VitTrack need model files from the user.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import hashlib
from pathlib import Path
from typing import Any

import cv2
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, TrackState
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers.code_version import sources_digest
from lmsco_ros.evaluation.trackers.interface import Answer
from lmsco_ros.evaluation.trackers.opencv_image import EightBitView

_CONTRIB_REMEDY = (
    'is not in this OpenCV; it needs the contrib build: pip install "lmsco_ros[peers]" '
    '(or: pip uninstall opencv-python-headless; pip install opencv-contrib-python-headless)')

# On smaller windows MOSSE's peak-to-sidelobe test leaves no side lobe, and it gives up at once.
_MOSSE_SMALLEST_SIDE = 32.0


@dataclass(frozen=True)
class _Recipe:
    """How OpenCV names a tracker, and what it needs."""

    attribute: str
    smallest_side: float = 1.0
    models: tuple[str, ...] = ()


_RECIPES: Mapping[str, _Recipe] = {
    'csrt': _Recipe('TrackerCSRT'),
    'kcf': _Recipe('TrackerKCF'),
    'mil': _Recipe('TrackerMIL'),
    'mosse': _Recipe('legacy.TrackerMOSSE', smallest_side=_MOSSE_SMALLEST_SIDE),
    'medianflow': _Recipe('legacy.TrackerMedianFlow'),
    'nanotrack': _Recipe('TrackerNano', models=('backbone', 'neckhead')),
    'vittrack': _Recipe('TrackerVit', models=('net',)),
}
OPENCV_NAMES = tuple(_RECIPES)
MODEL_FILES = {name: recipe.models for name, recipe in _RECIPES.items()}


class OpenCVTracker:
    """
    One of OpenCV's trackers behind the interface of the evaluation.

    Parameters
    ----------
    create : callable
        Returns a new OpenCV tracker.
    smallest_side : float
        Shorter sides of the start box are padded to this many pixels; the padding is
        taken off the answers again, in proportion to the tracker's estimate of scale.

    """

    in_process = True

    def __init__(self, create: Callable[[], Any], smallest_side: float = 1.0) -> None:
        """Keep the recipe; OpenCV's trackers start once only."""
        self._create = create
        self._smallest_side = smallest_side
        self._shrink = (1.0, 1.0)
        self._view: EightBitView | None = None
        self._tracker: Any = None
        self._last: BoundingBox | None = None

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start a new OpenCV tracker on `box`."""
        padded = BoundingBox.from_center(box.center, (
            max(box.width, self._smallest_side), max(box.height, self._smallest_side)))
        self._shrink = box.width / padded.width, box.height / padded.height
        self._view = EightBitView(image)
        self._tracker = self._create()
        self._tracker.init(self._view(image), _whole_pixels(padded, image.shape))
        self._last = box

    def update(self, image: npt.NDArray) -> Answer:
        """Track into `image`; the last box stays where OpenCV reports none."""
        assert self._view is not None, 'it starts with `initialize`'
        found, region = self._tracker.update(self._view(image))
        if found and region[2] > 0 and region[3] > 0:
            outer = BoundingBox(*map(float, region))
            size = outer.width * self._shrink[0], outer.height * self._shrink[1]
            self._last = BoundingBox.from_center(outer.center, size)
        return Answer(self._last, self._score(),
                      TrackState.TRACKING if found else TrackState.LOST)

    def close(self) -> None:
        """Release nothing; OpenCV counts references."""

    def _score(self) -> float | None:
        """Return OpenCV's score, which is -1 for trackers that do not have one."""
        ask = getattr(self._tracker, 'getTrackingScore', None)
        score = float(ask()) if ask else -1.0
        return score if score >= 0 else None


@dataclass(frozen=True)
class OpenCVSpec:
    """
    One of OpenCV's trackers by its name.

    Attributes
    ----------
    name : str
        One of `OPENCV_NAMES`.
    models : tuple of Path
        Model files, in the order that the tracker's recipe states; mostly empty.

    """

    name: str
    models: tuple[Path, ...] = ()

    @property
    def identity(self) -> str:
        """Version of OpenCV, digests of this module and of the model files."""
        digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in self.models]
        return ' '.join([f'opencv {cv2.__version__}', sources_digest((Path(__file__),)), *digests])

    @property
    def available(self) -> bool:
        """Whether this OpenCV has the tracker and its model files are given."""
        recipe = _RECIPES[self.name]
        return _lookup(recipe.attribute) is not None and len(self.models) == len(recipe.models)

    def build(self) -> OpenCVTracker:
        """Return the tracker, or raise `TrackerError` saying what is missing."""
        recipe = _RECIPES[self.name]
        kind = _lookup(recipe.attribute)
        if kind is None:
            raise TrackerError(f'tracker {self.name!r} {_CONTRIB_REMEDY}')
        if len(self.models) != len(recipe.models):
            files = ','.join(f'{model}.onnx' for model in recipe.models)
            raise TrackerError(f'tracker {self.name!r} needs its model files; '
                               f'name it as {self.name}:{files} with your paths')
        create = self._creator(kind, recipe)
        if recipe.models:
            self._try(create)
        return OpenCVTracker(create, recipe.smallest_side)

    def _try(self, create: Callable[[], Any]) -> None:
        """Raise `TrackerError` where OpenCV cannot use the model files."""
        try:
            create()
        except (cv2.error, TypeError) as error:
            files = ', '.join(str(path) for path in self.models)
            reason = str(error).strip().splitlines()[-1]
            raise TrackerError(f'tracker {self.name!r}: OpenCV cannot use the model files '
                               f'{files} ({reason}); give the ONNX files made for it') from error

    def _creator(self, kind: Any, recipe: _Recipe) -> Callable[[], Any]:
        if not recipe.models:
            return kind if not hasattr(kind, 'create') else kind.create
        parameters = _lookup(f'{recipe.attribute}_Params')()
        for field, path in zip(recipe.models, self.models):
            setattr(parameters, field, str(path))
        return lambda: kind.create(parameters)


def _lookup(attribute: str) -> Any:
    """Return a class of OpenCV by its dotted name, or None."""
    found: Any = cv2
    for part in attribute.split('.'):
        found = getattr(found, part, None)
    return found


def _whole_pixels(box: BoundingBox, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Return `box` rounded to pixels and cut to the image, which OpenCV demands."""
    left, top = max(round(box.x), 0), max(round(box.y), 0)
    right = min(max(round(box.x + box.width), left + 1), shape[1])
    bottom = min(max(round(box.y + box.height), top + 1), shape[0])
    return left, top, right - left, bottom - top
