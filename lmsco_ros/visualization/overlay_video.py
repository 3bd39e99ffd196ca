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

"""The overlays as a film: `overlay.mp4`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.media.colors import bgr, TRUTH_COLOR
from lmsco_ros.media.film import FilmWriter
from lmsco_ros.visualization.display_range import DisplayRange
from lmsco_ros.visualization.overlay import draw_box, draw_targets

# Below this height text hides much of the scene; small sensors are shown enlarged.
_COMFORTABLE_HEIGHT = 480


class OverlayVideo:
    """
    Frames with their results, one after the other; use as a context manager.

    Parameters
    ----------
    path : Path
        The mp4 file.
    fps : float
        Frames per second.

    Raises
    ------
    OSError
        From `add` and on leaving, when the film cannot be written; names the file.

    """

    def __init__(self, path: Path, fps: float) -> None:
        self._film = FilmWriter(path, min(max(fps, 1.0), 240.0))
        self._display_range = DisplayRange()

    def __enter__(self) -> OverlayVideo:
        """Return the film."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Finish the film."""
        self._film.close()

    def add(self, image: npt.NDArray, results: Mapping[int, TrackResult], *, label: str = '',
            truth: BoundingBox | None = None) -> npt.NDArray[np.uint8]:
        """
        Append one frame and return its 8-bit view without drawings.

        Parameters
        ----------
        image : ndarray, shape (H, W) or (H, W, 3)
            Frame as it was tracked.
        results : mapping of int to TrackResult
            What to draw, by the numbers of the targets; the first one with score and state.
        label : str
            Text for the lower left corner.
        truth : BoundingBox, optional
            Known box, drawn in white.

        """
        view = self._display_range.apply(image)
        factor = enlargement(view.shape[0])
        large = cv2.resize(view, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC) \
            if factor > 1 else view
        if truth is not None:
            large = np.asarray(
                cv2.cvtColor(large, cv2.COLOR_GRAY2BGR) if large.ndim == 2 else large.copy(),
                np.uint8)
            draw_box(large, scaled(truth, factor), bgr(TRUTH_COLOR), thickness=1)
        drawn = {number: replace(result, box=scaled(result.box, factor))
                 for number, result in results.items()}
        canvas = draw_targets(large, drawn, next(iter(drawn)), label=label)
        self._film.write(canvas)
        return view


def enlargement(height: int) -> int:
    """Return the whole factor that shows an image of `height` pixels comfortably."""
    return max(1, -(-_COMFORTABLE_HEIGHT // height)) if height < 0.7 * _COMFORTABLE_HEIGHT else 1


def scaled(box: BoundingBox, factor: float) -> BoundingBox:
    """Return `box` in an image that is `factor` times as large."""
    return BoundingBox(*(factor * value for value in box.as_tuple()))
