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
What a frame costs while the target is searched, beside one in which it is followed.

    python -m benchmarks.lost_frames DATASET [DATASET ...] [--split FILE --part test]
        [--only PATTERN ...] [--challenge disappear_3s] [--frames 200]

Each sequence is followed once from its first true box on, by the preset `default`, on one
thread. A frame is searched when the target was lost before it and is lost after it, and followed
when the state is TRACKING both times; all others belong to neither. Times are of the processor
and hold the training that a frame makes due.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import time

import numpy as np

from benchmarks.jittered_starts import chosen_sequences, sequence_options
from benchmarks.measurement import markdown_table
from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackState
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.geometry import is_absent

COLUMNS = ('frames', 'number', 'median ms', 'mean ms', 'p99 ms', 'mean / followed')
KINDS = {'followed': TrackState.TRACKING, 'searched': TrackState.LOST}


def costs(sequence: TrackingSequence) -> Iterator[tuple[TrackState, float]]:
    """Yield state and seconds of each frame whose state is that of the frame before."""
    first = int(np.flatnonzero(~is_absent(sequence.ground_truth))[0])
    tracker = LMSCOTracker()
    before = tracker.initialize(sequence.frames[first],
                                BoundingBox(*sequence.ground_truth[first])).state
    for index in range(first + 1, len(sequence)):
        image = sequence.frames[index]
        start = time.process_time()
        state = tracker.update(image).state
        seconds = time.process_time() - start
        if state is before:
            yield state, seconds
        before = state


def table(seen: Sequence[tuple[TrackState, float]]) -> str:
    """Return what frames of both kinds cost; exit where there are none of one."""
    rows, followed = [], None
    for name, wanted in KINDS.items():
        times = 1000 * np.array([seconds for state, seconds in seen if state is wanted])
        if not times.size:
            raise SystemExit(f'no frame is {name}; choose other sequences, or a challenge that '
                             'takes the target away, such as disappear_3s')
        followed = followed or times.mean()
        rows.append([name, str(times.size), f'{np.median(times):.2f}', f'{times.mean():.2f}',
                     f'{np.percentile(times, 99):.2f}', f'{times.mean() / followed:.2f}'])
    return markdown_table(COLUMNS, rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = sequence_options(__doc__.strip().splitlines()[0])
    parser.set_defaults(challenge='disappear_3s', frames=200)
    options = parser.parse_args(arguments)
    limit_threads(1)
    print(table([cost for sequence in chosen_sequences(options) for cost in costs(sequence)]))


if __name__ == '__main__':
    main()
