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
Time of one `update`, stage by stage, beside OpenCV's CSRT on the same frames.

Both trackers see every frame in turn, on one thread, so that a slow moment of the machine
meets both; quoted are medians over the frames, in milliseconds of wall time, and the ratio.
CSRT needs OpenCV's contrib build (extra `peers`); without it only the stages are printed.
With the package on the path:
python benchmarks/update_stages.py [--preset NAME] [--frames N] [--repetitions N]
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
import contextlib
import functools
import time
from typing import Any

import numpy as np

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig
from lmsco_ros.core import track
from lmsco_ros.core.features.extractor import FeatureExtractor
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.intensity import AutomaticGain
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from lmsco_ros.core.sampling import FrameView
from lmsco_ros.core.scale import ScaleFilter
from lmsco_ros.evaluation.trackers.opencv_peer import OpenCVSpec
from lmsco_ros.synthetic import render_scene, SceneConfig

# A stage counts its own time only: a patch taken for the scale belongs to `patch`.
STAGES = (
    ('gain', AutomaticGain, 'observe'),
    ('patch', FrameView, 'patch'),
    ('motion', MotionObserver, 'images'),
    ('features', FeatureExtractor, '__call__'),
    ('scores', StructuredOperator, 'scores'),
    ('peak', track, 'locate'),
    ('sharpness', track, 'peak_to_sidelobe_ratio'),
    ('scale', ScaleFilter, 'estimate'),
    ('scale training', ScaleFilter, 'learn'),
    ('memory', StructuredOperator, 'remember'),
    ('training', StructuredOperator, 'train'),
)


class StageClock:
    """Adds up the time that each stage spends in itself."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._running: list[float] = []

    def wrap(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its time taken."""
        @functools.wraps(function)
        def timed(*args: Any, **kwargs: Any) -> Any:
            self._running.append(0.0)
            start = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                spent = time.perf_counter() - start
                self.seconds[name] += spent - self._running.pop()
                if self._running:
                    self._running[-1] += spent
        return timed


@contextlib.contextmanager
def clocked(clock: StageClock) -> Iterator[None]:
    """Take the time of all stages inside the context."""
    originals = [(owner, attribute, getattr(owner, attribute)) for _, owner, attribute in STAGES]
    try:
        for name, owner, attribute in STAGES:
            setattr(owner, attribute, clock.wrap(name, getattr(owner, attribute)))
        yield
    finally:
        for owner, attribute, function in originals:
            setattr(owner, attribute, function)


def measure(preset: str, frames: Sequence[np.ndarray], box: BoundingBox,
            clock: StageClock) -> tuple[list[float], list[float]]:
    """Return the seconds per frame of our tracker and of CSRT, interleaved."""
    tracker = LMSCOTracker(TrackerConfig.preset(preset))
    peer = OpenCVSpec('csrt').build() if OpenCVSpec('csrt').available else None
    tracker.initialize(frames[0], box)
    if peer is not None:
        peer.initialize(frames[0], box)
    clock.seconds.clear()
    ours, theirs = [], []
    for frame in frames[1:]:
        start = time.perf_counter()
        tracker.update(frame)
        ours.append(time.perf_counter() - start)
        if peer is not None:
            start = time.perf_counter()
            peer.update(frame)
            theirs.append(time.perf_counter() - start)
    return ours, theirs


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--preset', default='default')
    parser.add_argument('--frames', type=int, default=150)
    parser.add_argument('--repetitions', type=int, default=3)
    options = parser.parse_args()
    scene = list(render_scene(SceneConfig(frames=options.frames)))
    clock = StageClock()
    stages, ours, theirs = [], [], []
    with clocked(clock):
        for _ in range(options.repetitions):
            mine, others = measure(options.preset, [frame.image for frame in scene],
                                   scene[0].box, clock)
            ours += mine
            theirs += others
            stages.append({name: clock.seconds[name] / len(mine) for name, _, _ in STAGES})
    print(f'{"stage":<16}{"ms per frame":>14}')
    for name, _, _ in STAGES:
        print(f'{name:<16}{1e3 * float(np.median([s[name] for s in stages])):>14.2f}')
    print(f'{"update, mean":<16}{1e3 * float(np.mean(ours)):>14.2f}')
    print(f'{"update, median":<16}{1e3 * float(np.median(ours)):>14.2f}')
    print(f'{"update, p99":<16}{1e3 * float(np.percentile(ours, 99)):>14.2f}')
    if theirs:
        print(f'{"CSRT, mean":<16}{1e3 * float(np.mean(theirs)):>14.2f}')
        print(f'{"CSRT / ours":<16}{float(np.mean(theirs) / np.mean(ours)):>14.2f}')


if __name__ == '__main__':
    main()
