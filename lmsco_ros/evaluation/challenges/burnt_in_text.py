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

"""Text that the camera draws into its pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.challenges.changed_frames import ChangedFrames, FRAMES_PER_SECOND
from lmsco_ros.evaluation.challenges.intensities import Span, stored
from lmsco_ros.evaluation.datasets import TrackingSequence

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_BLINK_FRAMES = 15
# Width of a letter at scale 1, in pixels, about.
_LETTER = 18


@dataclass(frozen=True)
class _Text:
    """Draws a clock, a reticle and a word that blinks where the target passes."""

    span: Span
    place: tuple[int, int]

    def __call__(self, image: npt.NDArray, frame: int) -> npt.NDArray:
        # OpenCV writes on 8-bit images only, so the letters are drawn apart.
        edge, face = (self._drawing(image.shape[:2], frame, thickness) for thickness in (3, 1))
        values = image.astype(np.float32)
        for cover, level in ((edge, self.span.low), (face, self.span.high)):
            cover = cover if image.ndim == 2 else cover[..., None]
            values += cover * (np.float32(level) - values)
        return stored(values, image.dtype)

    def _drawing(self, shape: tuple[int, ...], frame: int,
                 thickness: int) -> npt.NDArray[np.float32]:
        """Return which share of each pixel is written on."""
        cover = np.zeros(shape, np.uint8)
        height, width = shape
        scale = width / (36 * _LETTER)
        seconds = frame / FRAMES_PER_SECOND
        words = [(f'IR 12:00:{seconds:05.2f}', (4, round(30 * scale) + 4)),
                 (f'AZ {frame % 360:03d}', (4, height - 6))]
        if frame // _BLINK_FRAMES % 2:
            words.append(('REC', self.place))
        for word, place in words:
            cv2.putText(cover, word, place, _FONT, scale, 255, thickness, cv2.LINE_AA)
        cv2.drawMarker(cover, (width // 2, height // 2), 255, cv2.MARKER_CROSS, width // 12,
                       thickness)
        return cover.astype(np.float32) / np.float32(255)


def text(sequence: TrackingSequence) -> TrackingSequence:
    """Draw a running clock, a reticle, and a word that blinks at the target's mean place."""
    centers = sequence.ground_truth[:, :2] + sequence.ground_truth[:, 2:] / 2
    x, y = np.nanmean(centers, axis=0).astype(int).tolist()
    frames = ChangedFrames(sequence, range(len(sequence)),
                           _Text(Span.of(sequence), (x, y)), 'text')
    return replace(sequence, frames=frames)
