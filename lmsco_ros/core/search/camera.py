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

"""How the camera moves, as far as the background tells."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.core.imaging.gain import FrameSurvey

__all__ = ['background_motion', 'CameraMotion']

_Vector = npt.NDArray[np.float64]

# Frames over which the usual motion of the camera is measured.
_USUAL = 10
# Corners of the background: how many, how strong beside the strongest one, how far apart in
# pixels. Nothing is known unless _ENOUGH of them are found again within _AGREEING pixels of where
# their median is.
_CORNERS, _STRENGTH, _APART, _ENOUGH, _AGREEING = 40, 0.02, 4, 10, 2.0
# Lucas-Kanade: side of the window in pixels, and how often the picture is halved.
_WINDOW, _HALVINGS = 11, 2
# Gray levels of one deviation of a picture, and the equalization of its contrast: limit, tiles.
_LEVELS, _CONTRAST, _TILES = 40.0, 4.0, 4


@dataclass(frozen=True, eq=False)
class _Picture:
    """
    A frame in few pixels.

    Attributes
    ----------
    moment : float
        When it was taken, in frames.
    pattern : ndarray, shape (h, w), float32
        What it shows; of mean 0 and length 1.

    """

    moment: float
    pattern: npt.NDArray[np.float32]

    def way_to(self, other: _Picture) -> _Vector | None:
        """Return what the background has moved in another picture; None if it tells nothing."""
        return background_motion(_equalized(self.pattern), _equalized(other.pattern))


class CameraMotion:
    """
    By how much the camera moves otherwise than while the target was followed.

    The motion of a target in the image holds that of the camera. What is expected of a target that
    is not seen goes on with both; only what the camera does otherwise than before has to be added.
    While the target is followed, pictures are kept and nothing is computed.
    """

    def __init__(self) -> None:
        self._seen: deque[_Picture] = deque(maxlen=_USUAL + 1)
        self._usual: _Vector | None = None

    def observe(self, frame: FrameSurvey, moment: float, *, followed: bool) -> _Vector:
        """
        Take note of a frame.

        Parameters
        ----------
        frame : FrameSurvey
            The frame.
        moment : float
            When it was taken, in frames.
        followed : bool
            Whether the frame before has shown the target.

        Returns
        -------
        ndarray, shape (2,)
            What the background has moved since the last frame, in pixels (x, y), beyond what it
            usually does; 0 while the target is followed, or where the background tells nothing.

        """
        if frame.pattern is None:
            return np.zeros(2)
        before, now = list(self._seen), _Picture(moment, frame.pattern.reshape(frame.probe.shape))
        self._seen.append(now)
        if followed or not before:
            self._usual = None
            return np.zeros(2)
        if self._usual is None:
            self._usual = _rate(before[0], before[-1])
        way = before[-1].way_to(now)
        if way is None:
            return np.zeros(2)
        beyond = way - (moment - before[-1].moment) * self._usual
        return beyond * (frame.image.shape[1] / frame.probe.shape[1])

    def forget(self) -> None:
        """Take note that the view has changed at once."""
        self._seen.clear()
        self._usual = None


def background_motion(before: npt.NDArray[np.uint8],
                      now: npt.NDArray[np.uint8]) -> _Vector | None:
    """
    Return by how much what most of a picture shows has moved.

    Corners (Shi and Tomasi, "Good Features to Track", 1994) are followed through a pyramid (Lucas
    and Kanade, 1981; Bouguet, 2000). The median of their ways is that of the background, whatever
    targets do before it.

    Parameters
    ----------
    before, now : ndarray, shape (h, w), uint8
        Two pictures of the same scene.

    Returns
    -------
    ndarray, shape (2,), or None
        Its motion (x, y) in pixels; None where too few corners are found again, or agree.

    """
    corners = cv2.goodFeaturesToTrack(before, _CORNERS, _STRENGTH, _APART)
    if before.shape != now.shape or corners is None:
        return None
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        before, now, corners, corners.copy(), winSize=(_WINDOW, _WINDOW), maxLevel=_HALVINGS)
    ways = (moved - corners)[found == 1].astype(np.float64)
    if len(ways) < _ENOUGH:
        return None
    way = np.median(ways, axis=0)
    agreeing = np.abs(ways - way).max(axis=1) < _AGREEING
    return way if agreeing.sum() >= _ENOUGH else None


def _rate(first: _Picture, last: _Picture) -> _Vector:
    """Return what the background moves in a frame, from two pictures; 0 if it tells nothing."""
    way = first.way_to(last)
    return np.zeros(2) if way is None else way / max(1.0, last.moment - first.moment)


def _equalized(pattern: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """Return a picture with as much contrast everywhere."""
    levels = np.clip(128 + _LEVELS * pattern.size**0.5 * pattern, 0, 255).astype(np.uint8)
    return cv2.createCLAHE(_CONTRAST, (_TILES, _TILES)).apply(levels)
