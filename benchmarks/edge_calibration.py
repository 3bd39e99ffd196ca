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
How many edges of told boxes lie within one and two of their deviations from the true ones.

    python -m benchmarks.edge_calibration DATASET [--split FILE --part test] [--processes 2]

Every sequence is followed once from its first true box on. Counted are frames that are not LOST
and in which the box touches the target; sequences weigh by their frames.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.extent_sheet import edge_deviations
from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackState
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.split import load_split


def corners(box: BoundingBox) -> npt.NDArray[np.float64]:
    """Return left, top, right and bottom edge of a box."""
    return np.array([box.x, box.y, box.x + box.width, box.y + box.height])


def normalized_errors(sequence: TrackingSequence) -> npt.NDArray[np.float64]:
    """Return the errors of the edges over their deviations, shape (frames, 4)."""
    limit_threads(1)
    truth, absent = sequence.ground_truth, is_absent(sequence.ground_truth)
    start = int(np.flatnonzero(~absent)[0])
    tracker, errors = LMSCOTracker(), []
    tracker.initialize(sequence.frames[start], BoundingBox(*truth[start]))
    for number in range(start + 1, len(sequence)):
        result = tracker.update(sequence.frames[number])
        if absent[number] or result.state is TrackState.LOST:
            continue
        box = BoundingBox(*truth[number])
        if result.box.overlap(box) > 0:
            errors.append((corners(result.box) - corners(box)) / edge_deviations(result))
    return np.array(errors).reshape(-1, 4)


def main() -> None:
    """Follow the sequences that the command line asks for, and print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('dataset', type=Path)
    parser.add_argument('--split', type=Path)
    parser.add_argument('--part', default='test')
    parser.add_argument('--processes', type=int, default=2)
    options = parser.parse_args()
    sequences = list(scan_dataset(options.dataset).sequences)
    if options.split is not None:
        sequences = list(load_split(options.split).select(options.part, sequences))
    with ProcessPoolExecutor(options.processes) as executor:
        errors = np.abs(np.concatenate(list(executor.map(normalized_errors, sequences))))
    print(f'{len(sequences)} sequences, {len(errors)} frames, {errors.size} edges: '
          f'{(errors < 1).mean():.3f} within one deviation, '
          f'{(errors < 2).mean():.3f} within two')


if __name__ == '__main__':
    main()
