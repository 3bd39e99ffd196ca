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
The process of `benchmarks.before_after` that tracks with the core of one checkout.

Run by its path in a checkout that is first in PYTHONPATH: all imports are those of the checkout.
It tracks through the clip in a file, one frame for each line on standard input, and answers with
the processor time of the update and of its stages, in seconds, as a line of JSON.
"""

from __future__ import annotations

import json
import sys

import numpy as np

from benchmarks.measurement import CLOCKS, named_config
from benchmarks.stages import instrumented, StageClock
from lmsco_ros.core import BoundingBox, LMSCOTracker


def main(config: str, clip: str) -> None:
    """Answer every line with the times of one frame."""
    with np.load(clip) as arrays:
        frames, start = arrays['frames'], BoundingBox(*map(float, arrays['start']))
    tracker = LMSCOTracker(named_config(config))
    clock = StageClock(CLOCKS['processor'])
    with instrumented(clock):
        tracker.initialize(frames[0], start)
        for frame, _ in zip(frames[1:], sys.stdin):
            clock.seconds.clear()
            total = clock.spent(lambda: tracker.update(frame))
            print(json.dumps({'total': total, 'stages': dict(clock.seconds)}), flush=True)


if __name__ == '__main__':
    main(*sys.argv[1:])
