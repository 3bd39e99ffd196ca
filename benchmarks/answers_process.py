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
The process of `benchmarks.same_answers` that tracks with the core of one checkout.

Run by its path, with that checkout first in PYTHONPATH. It reads names of clips and of files for
the answers from standard input, tracks through each clip with the public interface of the core
alone, and says when it is done.
"""

from __future__ import annotations

import sys

import numpy as np

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig


def answers(tracker: LMSCOTracker, frames: np.ndarray, start: np.ndarray) -> dict[str, np.ndarray]:
    """Return boxes, states and scores of all frames."""
    first = tracker.initialize(frames[0], BoundingBox(*map(float, start)))
    results = [first, *map(tracker.update, frames[1:])]
    return {'boxes': np.array([result.box.as_tuple() for result in results]),
            'states': np.array([result.state.value for result in results]),
            'scores': np.array([result.score for result in results])}


def main(preset: str) -> None:
    """Answer one clip after the other."""
    tracker = LMSCOTracker(TrackerConfig.preset(preset))
    for line in sys.stdin:
        clip, output = line.rstrip('\n').split('\t')
        with np.load(clip) as arrays:
            np.savez(output, **answers(tracker, arrays['frames'], arrays['start']))
        print('done', flush=True)


if __name__ == '__main__':
    main(*sys.argv[1:])
