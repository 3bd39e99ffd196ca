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

"""A track frame by frame: its stages, and beside it the work that no tracker could leave out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.measurement import CLOCKS, markdown_table
from benchmarks.scenes import Clip
from benchmarks.stages import CallRecorder, FORWARD, FOURIER, instrumented, StageClock, TRAINING
from lmsco_ros.core import LMSCOTracker, TrackerConfig
from lmsco_ros.core.backend import limit_threads

__all__ = ['FrameProfile', 'Profile', 'amortized', 'floor_table', 'profile_track', 'stage_table']

REST = 'everything else'


@dataclass(frozen=True)
class FrameProfile:
    """
    One frame, in seconds.

    Attributes
    ----------
    total : float
        The whole `update`.
    stages : dict of str to float
        Own time of each stage that ran.
    floor : dict of str to float
        The same forward passes and Fourier transforms made again on their own, right after.
    trained : bool
        Whether the filter was trained.

    """

    total: float
    stages: dict[str, float]
    floor: dict[str, float]
    trained: bool


@dataclass(frozen=True)
class Profile:
    """
    All frames of a track after the first.

    Attributes
    ----------
    frames : list of FrameProfile
        In the order of time.
    inputs : dict of str to tuple of int
        Shape of the input of each network.
    missing : list of str
        Stages that this version of the core does not have.

    """

    frames: list[FrameProfile]
    inputs: dict[str, tuple[int, ...]]
    missing: list[str]


def profile_track(config: TrackerConfig, clip: Clip, clock_name: str = 'processor',
                  threads: int = 1) -> Profile:
    """
    Track through a clip with the time of all stages taken.

    Parameters
    ----------
    config : TrackerConfig
        How to track.
    clip : Clip
        Frames and the box to start with.
    clock_name : {'processor', 'wall'}
        Time to take.
    threads : int
        Threads of the numerical libraries.

    """
    clock, recorder = StageClock(CLOCKS[clock_name]), CallRecorder()
    with instrumented(clock, recorder) as missing:
        tracker = LMSCOTracker(config)
        limit_threads(threads)
        tracker.initialize(clip.frames[0], clip.start)
        taken = [_profile_frame(tracker, frame, clock, recorder) for frame in clip.frames[1:]]
    return Profile(taken, recorder.shapes, missing)


def _profile_frame(tracker: LMSCOTracker, frame: np.ndarray, clock: StageClock,
                   recorder: CallRecorder) -> FrameProfile:
    """Track into one frame, then repeat what is its floor."""
    clock.seconds.clear()
    recorder.calls.clear()
    total = clock.spent(lambda: tracker.update(frame))
    stages = dict(clock.seconds)
    stages[REST] = total - sum(stages.values())
    floor = {kind: recorder.replay(kind, clock.spent) for kind in (FORWARD, FOURIER)}
    return FrameProfile(total, stages, floor, TRAINING in stages)


def amortized(frames: Sequence[FrameProfile], value: Callable[[FrameProfile], float],
              ) -> tuple[float, float, float]:
    """
    Return what a frame costs without training, with it, and on average.

    The first two are medians, NaN where there is no such frame; the average is theirs, weighted
    by how often each occurs, which single slow frames do not move.
    """
    groups = [[value(frame) for frame in frames if frame.trained is trained]
              for trained in (False, True)]
    medians = [float(np.median(group)) if group else float('nan') for group in groups]
    average = sum(len(group) * median for group, median in zip(groups, medians) if group)
    return medians[0], medians[1], average / len(frames)


def stage_table(frames: Sequence[FrameProfile]) -> str:
    """Return the stages in milliseconds, the most expensive first."""
    names = {name for frame in frames for name in frame.stages} - {REST}
    costs = {name: amortized(frames, lambda frame: frame.stages.get(name, 0.0))
             for name in names}
    order = sorted(names, key=lambda name: -costs[name][2])
    costs[REST] = amortized(frames, lambda frame: frame.stages[REST])
    whole = amortized(frames, lambda frame: frame.total)
    rows = [(name, *_milliseconds(costs[name]), f'{costs[name][2] / whole[2]:.1%}')
            for name in (*order, REST)]
    rows.append(('**update**', *_milliseconds(whole), '100 %'))
    return markdown_table(
        ('stage', 'other frames (ms)', 'training frames (ms)', 'on average (ms)', 'share'), rows)


def floor_table(frames: Sequence[FrameProfile], kinds: Sequence[str] = (FORWARD, FOURIER)) -> str:
    """Return what of the frame cannot be left out, and how far the frame is from it."""
    def floor(frame: FrameProfile) -> float:
        return sum(frame.floor[kind] for kind in kinds)

    rows = [(f'{kind} alone', *_milliseconds(
        amortized(frames, lambda frame: frame.floor[kind]))) for kind in kinds]
    bottom = amortized(frames, floor)
    whole = amortized(frames, lambda frame: frame.total)
    if len(kinds) > 1:
        rows.append(('floor', *_milliseconds(bottom)))
    rows.append(('**update / floor**', *(a / b if b > 0 else float('nan')
                                         for a, b in zip(whole, bottom))))
    return markdown_table(('floor', 'other frames (ms)', 'training frames (ms)',
                           'on average (ms)'), rows)


def _milliseconds(values: Sequence[float]) -> tuple[float, ...]:
    """Return seconds as milliseconds."""
    return tuple(1e3 * value for value in values)
