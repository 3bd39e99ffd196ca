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
Where a target that is not seen is expected, with what the camera does and without.

    python -m benchmarks.camera_motion DATASET [DATASET ...] [--split FILE --part train]
        [--only PATTERN ...] [--challenge NAME] [--frames 400]

Every tenth frame of each sequence the true boxes of the last 20 frames are followed, and the
target is not seen from then on. Told is how far the predicted center is from the true one, in
sides of the target: for each sequence the mean, and the median and the mean over sequences.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import math

import numpy as np

from benchmarks.jittered_starts import chosen_sequences, sequence_options
from benchmarks.measurement import markdown_table
from lmsco_ros.core import BoundingBox, TrackerConfig
from lmsco_ros.core.imaging.gain import FrameSurvey, survey
from lmsco_ros.core.search.course import Course
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.geometry import is_absent

COLUMNS = ('frames not seen', 'sequences', 'median without', 'median with', 'mean without',
           'mean with')
HORIZONS = (10, 30, 60)
_FOLLOWED, _EVERY = 20, 10
_EXACT = 0.01


def followed(frames: Sequence[FrameSurvey], boxes: Sequence[BoundingBox]) -> Course:
    """Return the course of a target with these boxes in frames."""
    course = Course(boxes[0], None)
    for frame, box in zip(frames[1:], boxes[1:], strict=True):
        course.next_frame(None)
        course.look_around(frame)
        course.follow(box)
        course.measure(box, _EXACT * box.area * np.eye(4), None)
    return course


def expectations(course: Course, frames: Sequence[FrameSurvey], camera: bool
                 ) -> Iterator[tuple[float, float]]:
    """Yield where (x, y) the target is expected in frames that do not show it."""
    for frame in frames:
        course.next_frame(None)
        if camera:
            course.look_around(frame)
        course.missed(None)
        yield course.predicted.center


def errors(sequence: TrackingSequence, camera: bool) -> np.ndarray:
    """Return mean errors for all horizons, in sides of the target; NaN where there are none."""
    config = TrackerConfig.preset('default').intensity
    truth, absent = sequence.ground_truth, is_absent(sequence.ground_truth)
    frames = [survey(sequence.frames[index], config) for index in range(len(sequence))]
    found: list[list[float]] = []
    for start in range(_FOLLOWED, len(frames) - max(HORIZONS), _EVERY):
        before, after = slice(start - _FOLLOWED, start + 1), slice(start + 1, None)
        ends = [start + horizon for horizon in HORIZONS]
        if absent[before].any() or absent[ends].any():
            continue
        course = followed(frames[before], [BoundingBox(*box) for box in truth[before]])
        places = list(expectations(course, frames[after][:max(HORIZONS)], camera))
        found.append([_off(places[end - start - 1], truth[end]) for end in ends])
    return np.mean(found, axis=0) if found else np.full(len(HORIZONS), np.nan)


def _off(place: tuple[float, float], box: np.ndarray) -> float:
    """Return how far a place is from the center of a box, in sides."""
    target = BoundingBox(*box)
    return math.dist(place, target.center) / target.area**0.5


def table(sequences: Sequence[TrackingSequence]) -> str:
    """Return the errors with and without the motion of the camera."""
    without, with_camera = (np.array([errors(sequence, camera) for sequence in sequences])
                            for camera in (False, True))
    told = np.isfinite(without[:, 0])
    if not told.any():
        raise SystemExit(f'no sequence shows its target for {_FOLLOWED + max(HORIZONS)} frames in '
                         'a row; give longer ones, or more --frames')
    rows = [[str(horizon), str(int(told.sum())), float(np.median(one)), float(np.median(other)),
             float(one.mean()), float(other.mean())]
            for horizon, one, other in zip(
                HORIZONS, without[told].T, with_camera[told].T, strict=True)]
    return markdown_table(COLUMNS, rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = sequence_options(__doc__.strip().splitlines()[0])
    parser.set_defaults(frames=400)
    print(table(chosen_sequences(parser.parse_args(arguments))))


if __name__ == '__main__':
    main()
