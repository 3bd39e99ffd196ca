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

"""Pictures from sequences: thumbnails and strips of what went wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.datasets.frames import FrameSource
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.media.colors import bgr, TRUTH_COLOR

Picture = npt.NDArray[np.uint8]
Boxes = npt.NDArray[np.float64]

_THUMBNAIL = (132, 100)
_PANEL = (210, 160)
_GAP = 4


@dataclass(frozen=True)
class _Mark:
    """A box to be drawn, its color as `#rrggbb` and the width of the line."""

    box: Boxes
    color: str
    line: int = 1


def thumbnail(sequence: TrackingSequence) -> Picture:
    """Return a small picture of the first frame with a target, its true box marked."""
    index = int(np.flatnonzero(~is_absent(sequence.ground_truth))[0])
    view = _display(sequence.frames[index])
    return _panel(view, _whole(view), [_Mark(sequence.ground_truth[index], TRUTH_COLOR)],
                  _THUMBNAIL)


def failure_strip(images: FrameSource, truth: Boxes, answers: Boxes, frames: Sequence[int],
                  color: str) -> Picture:
    """
    Return pictures of some frames side by side.

    Parameters
    ----------
    images : FrameSource
        Images of the sequence.
    truth, answers : ndarray, shape (n, 4)
        True boxes, drawn in `TRUTH_COLOR`, and the tracker's, drawn in `color`.
    frames : sequence of int
        Frames to show; each picture is cut to where the two boxes are.
    color : str
        Color of the tracker as `#rrggbb`.

    Returns
    -------
    ndarray, shape (height, width, 3), uint8
        BGR picture.

    """
    panels = []
    for index in frames:
        view = _display(images[index])
        marks = [_Mark(answers[index], color, line=2), _Mark(truth[index], TRUTH_COLOR)]
        panel = _panel(view, _region(view, [mark.box for mark in marks]), marks, _PANEL)
        _caption(panel, f'{index}')
        panels += [panel, np.full((_PANEL[1], _GAP, 3), 255, np.uint8)]
    return np.hstack(panels[:-1])


def encode(picture: Picture, ending: str) -> bytes:
    """Return the picture as file content; `ending` is '.png' or '.jpg'."""
    quality = [cv2.IMWRITE_JPEG_QUALITY, 86] if ending == '.jpg' else []
    return cv2.imencode(ending, picture, quality)[1].tobytes()


def _display(image: npt.NDArray) -> Picture:
    """Return an 8-bit BGR view with the contrast of the scene."""
    if image.dtype != np.uint8 or image.ndim == 2:
        low, high = np.percentile(image[np.isfinite(image)], (0.5, 99.5))
        scaled = (image.astype(np.float32) - low) * (255 / max(float(high - low), 1e-6))
        image = np.clip(np.nan_to_num(scaled), 0, 255).astype(np.uint8)
    return np.asarray(
        cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image, np.uint8)


def _whole(view: Picture) -> npt.NDArray[np.float64]:
    return np.array([0, 0, view.shape[1], view.shape[0]], dtype=float)


def _region(view: Picture, boxes: list[npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """Return the part of the image around boxes, in the shape of a panel."""
    known = [box for box in boxes if np.isfinite(box).all()]
    if not known:
        return _whole(view)
    low = np.min([box[:2] for box in known], axis=0)
    high = np.max([box[:2] + box[2:] for box in known], axis=0)
    aspect = _PANEL[0] / _PANEL[1]
    height = max((high - low)[1], (high - low)[0] / aspect) * 1.8
    height = min(max(height, 64.0), view.shape[0], view.shape[1] / aspect)
    size = np.array([height * aspect, height])
    corner = np.clip((low + high) / 2 - size / 2, 0, [view.shape[1], view.shape[0]] - size)
    return np.concatenate([corner, size])


def _panel(view: Picture, region: npt.NDArray[np.float64], marks: list[_Mark],
           size: tuple[int, int]) -> Picture:
    """Return a region of the image enlarged into a panel, with boxes drawn on it."""
    scale = min(size[0] / region[2], size[1] / region[3])
    offset = (np.array(size) - region[2:] * scale) / 2 - region[:2] * scale
    transform = np.array([[scale, 0, offset[0]], [0, scale, offset[1]]])
    method = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    panel = np.asarray(cv2.warpAffine(view, transform, size, flags=method), np.uint8)
    for mark in marks:
        if np.isfinite(mark.box).all():
            low = np.round(mark.box[:2] * scale + offset).astype(int)
            high = np.round((mark.box[:2] + mark.box[2:]) * scale + offset).astype(int)
            cv2.rectangle(panel, low.tolist(), high.tolist(), bgr(mark.color), mark.line,
                          cv2.LINE_AA)
    return panel


def _caption(panel: Picture, text: str) -> None:
    for color, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(panel, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.42, color, thickness,
                    cv2.LINE_AA)
