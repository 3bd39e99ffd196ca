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
A preset as the VOT toolkit drives it since 0.9: in Python, without TraX (`docs/vot.md`).

The toolkit makes a `Tracker` in a process of its own, from `protocol = python` and the
`command = lmsco_ros.evaluation.vot_tracker:Tracker`, and calls `init` and `update` with the path
of an image, or with one for each channel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lmsco_ros.core import BoundingBox, BoxError, ImageError, LMSCOTracker, TrackResult
from lmsco_ros.evaluation.datasets.row_forms import enclosing
from lmsco_ros.media.errors import MediaError
from lmsco_ros.media.image_files import ImageFiles

Region = tuple[float, float, float, float]
Status = tuple[Region, dict[str, Any]]

# Channels of a sequence that has several, the one that is wanted first.
_CHANNELS = ('ir', 'infrared', 'thermal')


class Tracker:
    """
    One object of the toolkit.

    Parameters
    ----------
    preset : str, default 'default'
        Named configuration; `arg_preset = hcs` in the toolkit's `trackers.ini`.

    """

    multiobject = False

    def __init__(self, preset: str = 'default') -> None:
        """Build the tracker."""
        self._tracker = LMSCOTracker(preset)

    def init(self, frame: str | Mapping[str, str], new: tuple[Any, Mapping[str, Any]],
             properties: Mapping[str, Any]) -> Status:
        """
        Start on the object, forgetting any earlier one.

        Parameters
        ----------
        frame : str or mapping of str to str
            File of the image, or of that of each channel.
        new : (region, mapping)
            Rectangle x, y, width, height, or corners of a polygon.
        properties : mapping
            Not used.

        Raises
        ------
        BoxError
            When the region is a mask.

        """
        self._tracker.reset()
        return _status(self._tracker.initialize(_image(frame), _box(new[0])))

    def update(self, frame: str | Mapping[str, str], new: Sequence[Any],
               properties: Mapping[str, Any]) -> Status:
        """Return where the object is in the next image, with its score and state."""
        return _status(self._tracker.update(_image(frame)))


def _image(frame: str | Mapping[str, str]) -> np.ndarray:
    if not isinstance(frame, str):
        frame = frame[next((name for name in _CHANNELS if name in frame), next(iter(frame)))]
    try:
        return ImageFiles((Path(frame),))[0]
    except MediaError as error:
        raise ImageError(f'{frame}: {error}') from error


def _box(region: Any) -> BoundingBox:
    """Return the upright box around a region."""
    if isinstance(region, tuple) and len(region) == 4:
        return BoundingBox(*region)
    if isinstance(region, list) and all(len(point) == 2 for point in region):
        return BoundingBox(*enclosing([value for point in region for value in point]))
    raise BoxError('the toolkit sent a mask; set `convert = rectangle` in trackers.ini')


def _status(result: TrackResult) -> Status:
    return result.box.as_tuple(), {'confidence': float(result.score), 'state': result.state.value}
