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
How the time of a frame grows: image, target, memory, scales, threads, number of targets.

Every curve varies one thing. Its points take turns, one update each, so that a slow moment of the
machine meets them all; the memory of samples is full before the time is taken. Quoted are medians
of frames with training and of others, and their average weighted by how often each occurs. Each
curve becomes a picture in the output folder. In the folder of the repository:
python -m benchmarks.scaling [--config NAME_OR_FILE] [--frames N] [--output FOLDER]
    [--curve NAME ...]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import os
from pathlib import Path

import numpy as np

from benchmarks.footprint import measure_footprint
from benchmarks.measurement import (
    CLOCKS, markdown_table, named_config, positive, PROCESSOR, take_turns, WALL)
from benchmarks.scenes import Clip, moving_scene
from benchmarks.stages import instrumented, Stage, StageClock, STAGES, TRAINING
from lmsco_ros.core import MultiTracker, TrackerConfig, TrackState
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.evaluation.report.style import looks, new_axes

CLIP_FRAMES = 16
IMAGE, TARGET = (640, 512), 40
IMAGES = ((320, 256), (640, 512), (960, 768), (1280, 1024), (1920, 1080))
TARGETS = (12, 20, 40, 80, 150, 300)
TARGET_IMAGE = (1280, 1024)
MEMORIES = (1, 10, 20, 30, 50, 80)
SCALES = (1, 3, 7, 11, 17)
THREADS = (1, 2)
COUNTS = (1, 2, 4, 8, 16)


@dataclass(frozen=True)
class Point:
    """
    One point of a curve.

    Attributes
    ----------
    name : str
        For tables.
    x : float
        Place on the axis.
    config : TrackerConfig
        How to track.
    clip : Clip
        Where.
    threads : int
        Threads of the numerical libraries.

    """

    name: str
    x: float
    config: TrackerConfig
    clip: Clip
    threads: int = 1


@dataclass(frozen=True)
class Cost:
    """
    What an update costs at a point, in milliseconds of one clock.

    Attributes
    ----------
    other, training, average : float
        Medians of frames without and with training, and their weighted average.
    tracking : float
        Share of frames in which the target was not missed; a search of the whole image, which
        others begin, costs more.

    """

    other: float
    training: float
    average: float
    tracking: float


@dataclass(frozen=True)
class Curve:
    """
    What is varied; the last point over the first is its ratio.

    Attributes
    ----------
    title, axis : str
        For the picture.
    points : callable
        Returns the points for a configuration.
    logarithmic : bool
        Whether the axis is.

    """

    title: str
    axis: str
    points: Callable[[TrackerConfig], list[Point]]
    logarithmic: bool = False


class Runner:
    """
    A tracker that has filled its memory and goes on for ever.

    Parameters
    ----------
    point : Point
        What to track, where and how.
    clock : StageClock
        Sees the training.

    """

    def __init__(self, point: Point, clock: StageClock) -> None:
        self._point, self._clock = point, clock
        self.trained: list[bool] = []
        self.missed: list[bool] = []
        self._tracker = MultiTracker(point.config)
        for box in (point.clip.start, *point.clip.others):
            self._tracker.initialize(point.clip.frames[0], box)
        self._done = 0
        for _ in range(point.config.learning.memory_size):
            self._advance()

    def prepare(self) -> None:
        """Set what belongs to the whole process."""
        limit_threads(self._point.threads)
        self._clock.seconds.clear()

    def step(self) -> None:
        """Track into the next frame."""
        self.missed.append(self._advance())

    def note(self) -> None:
        """Remember what the frame was like."""
        self.trained.append(TRAINING in self._clock.seconds)

    def _advance(self) -> bool:
        """Track into the next frame; return whether a target was missed."""
        self._done += 1
        results = self._tracker.update(self._point.clip.endless(self._done))
        return any(result.state is not TrackState.TRACKING for result in results.values())


def measure_curve(points: Sequence[Point], frames: int) -> dict[int, list[Cost]]:
    """
    Return the costs of all points.

    Parameters
    ----------
    points : sequence of Point
        They take turns.
    frames : int
        Updates of each.

    Returns
    -------
    dict of list of Cost
        For the columns PROCESSOR and WALL.

    """
    clock = StageClock(CLOCKS['processor'])
    training: tuple[Stage, ...] = tuple(stage for stage in STAGES if stage.name == TRAINING)
    with instrumented(clock, stages=training):
        runners = [Runner(point, clock) for point in points]
        seconds = take_turns(runners, frames)
    return {column: [_cost(runner, 1e3 * seconds[:, index, column])
                     for index, runner in enumerate(runners)] for column in (PROCESSOR, WALL)}


def _cost(runner: Runner, times: np.ndarray) -> Cost:
    """Return the cost at one point."""
    trained = np.array(runner.trained)
    other, training = (float(np.median(times[mask])) if mask.any() else np.nan
                       for mask in (~trained, trained))
    average = np.nansum([np.mean(~trained) * other, np.mean(trained) * training])
    return Cost(other, training, float(average), 1 - float(np.mean(runner.missed)))


def image_points(config: TrackerConfig) -> list[Point]:
    """Return the same target in images of different sizes."""
    return [Point(f'{width}x{height}', width * height / 1e6, config,
                  moving_scene((width, height), TARGET, CLIP_FRAMES))
            for width, height in IMAGES]


def target_points(config: TrackerConfig) -> list[Point]:
    """Return targets of different sizes in the same image."""
    return [Point(f'{side} px', side, config, moving_scene(TARGET_IMAGE, side, CLIP_FRAMES))
            for side in TARGETS]


def memory_points(config: TrackerConfig) -> list[Point]:
    """Return memories of different sizes."""
    clip = moving_scene(IMAGE, TARGET, CLIP_FRAMES)
    return [Point(str(count), count, replace(
        config, learning=replace(config.learning, memory_size=count)), clip)
        for count in MEMORIES]


def scale_points(config: TrackerConfig) -> list[Point]:
    """Return different numbers of scales, symmetrical around the last one."""
    clip = moving_scene(IMAGE, TARGET, CLIP_FRAMES)
    return [Point(str(count), count, replace(config, scale=replace(
        config.scale, exponent_min=-(count // 2),
        exponent_max=count // 2)), clip) for count in SCALES]


def thread_points(config: TrackerConfig) -> list[Point]:
    """Return different numbers of threads."""
    clip = moving_scene(IMAGE, TARGET, CLIP_FRAMES)
    return [Point(str(count), count, config, clip, count) for count in THREADS]


def count_points(config: TrackerConfig) -> list[Point]:
    """Return different numbers of targets in the same image."""
    return [Point(str(count), count, config, moving_scene(
        IMAGE, TARGET, CLIP_FRAMES, vehicles=count)) for count in COUNTS]


CURVES: Mapping[str, Curve] = {
    'image': Curve('Size of the image, the same target', 'pixels of the image', image_points),
    'target': Curve('Size of the target, the same image', 'side in pixels', target_points, True),
    'memory': Curve('Samples in memory', 'samples', memory_points),
    'search': Curve('Scales searched by the filter', 'scales', scale_points),
    'threads': Curve('Threads', 'threads', thread_points),
    'targets': Curve('Targets, one tracker', 'targets', count_points),
}


def report_curve(name: str, config: TrackerConfig, frames: int, output: Path) -> None:
    """Measure a curve; print its table and its ratio, and draw it."""
    curve = CURVES[name]
    points = curve.points(config)
    costs = measure_curve(points, frames)
    rows = [(point.name, own.other, own.training, own.average, wall.average,
             f'{own.tracking:.0%}')
            for point, own, wall in zip(points, costs[PROCESSOR], costs[WALL], strict=True)]
    print(f'\n## {curve.title}\n')
    print(markdown_table(
        (name, 'other frames (ms)', 'training frames (ms)', 'on average (ms)',
         'on the clock (ms)', 'tracking'), rows))
    if name == 'threads':
        print(f'\nOMP_WAIT_POLICY: {os.environ.get("OMP_WAIT_POLICY", "not set")}; threads that '
              'wait actively cost most where cores are busy.')
    own, wall = ([cost.average for cost in costs[column]] for column in (PROCESSOR, WALL))
    print(f'\n{points[-1].name} over {points[0].name}: {own[-1] / own[0]:.2f} '
          f'(on the clock {wall[-1] / wall[0]:.2f})')
    if name == 'targets':
        further = (own[-1] / own[0] - 1) / (points[-1].x - 1)
        print(f'Each further target costs {further:.2f} of the first.')
    _draw(curve, points, costs, output / f'{name}.png')


def _draw(curve: Curve, points: Sequence[Point], costs: Mapping[int, Sequence[Cost]],
          path: Path) -> None:
    """Write the picture of a curve."""
    figure, axes = new_axes(curve.title, curve.axis, 'milliseconds a frame')
    x = [point.x for point in points]
    lines = {'training frames, processor': [cost.training for cost in costs[PROCESSOR]],
             'on average, processor': [cost.average for cost in costs[PROCESSOR]],
             'other frames, processor': [cost.other for cost in costs[PROCESSOR]],
             'on average, on the clock': [cost.average for cost in costs[WALL]]}
    for (label, look), values in zip(looks(lines).items(), lines.values(), strict=True):
        axes.plot(x, values, color=look.color, marker=look.marker, markersize=5, label=label)
    if curve.logarithmic:
        axes.set_xscale('log')
    axes.set_xticks(x, [point.name for point in points], rotation=30, ha='right')
    axes.minorticks_off()
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=8, frameon=False)
    figure.savefig(path)


def main(arguments: list[str] | None = None) -> None:
    """Print the tables and write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--config', default='default', help='preset or YAML file')
    parser.add_argument('--frames', type=positive, default=60, help='of each point')
    parser.add_argument('--output', type=Path, default=Path('output/scaling'))
    parser.add_argument('--curve', action='append', choices=(*CURVES, 'footprint'),
                        help='all unless given')
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    config = named_config(options.config)
    print(f'# `{options.config}`, {options.frames} updates of each point')
    for name in options.curve or (*CURVES, 'footprint'):
        if name == 'footprint':
            _report_footprint(config)
        else:
            report_curve(name, config, options.frames, options.output)


def _report_footprint(config: TrackerConfig) -> None:
    """Print what trackers hold in memory."""
    found = measure_footprint(config)
    print('\n## Memory (MiB)\n')
    print(markdown_table(('part', 'MiB'), [
        ('libraries, imported', found.libraries),
        ('first tracker, with what the libraries then take', found.first),
        ('each further tracker', found.further),
        ('arrays of one tracker (NumPy)', found.arrays),
        ('the same at the highest', found.peak)]))


if __name__ == '__main__':
    main()
