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
How close the training comes to the minimum of its objective, over a whole sequence.

The tracker follows the target once. Every sample that it stores is given to further filters, one
for each loss and each budget of training, so that all of them train on the same samples. Each
frame then has the objective of a filter over that of a filter of the same loss which takes many
iterations in every frame. In the folder of the repository:
python -m benchmarks.objective [--config NAME_OR_FILE] [--frames N] [--output PNG]
    [--sequence DATASET/GROUP/NAME]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
import numpy as np

from benchmarks.measurement import markdown_table, named_config, positive
from benchmarks.scenes import Clip, recorded_clips, walking_scene
from lmsco_ros.core import LMSCOTracker, TrackerConfig
from lmsco_ros.core.backend import Array, Backend
from lmsco_ros.core.config import LearningConfig
from lmsco_ros.core.detection import detector
from lmsco_ros.core.learning.structured_operator import StructuredOperator
from lmsco_ros.evaluation.report.style import looks, style_axes
from lmsco_ros.evaluation.session import Request

LOSSES: dict[str, dict[str, Any]] = {
    'unit anchor': {'loss': 'unit'},
    'coupled anchor': {'loss': 'coupled'},
    'ridge': {'loss': 'ridge'},
}
CONVERGED = {'iterations': 30, 'gradient_steps': 2, 'update_interval': 1}
PAPER = {'iterations': 3, 'gradient_steps': 2, 'update_interval': 5}
_TICKS = (1, 1.2, 1.5, 2, 3, 5, 7)


@dataclass(frozen=True)
class Lesson:
    """
    What a tracker gave its filter to learn from.

    Attributes
    ----------
    start : tuple
        Sample of the first frame, size of the target in periods, and backend: the arguments of
        `StructuredOperator` after the configuration.
    samples : dict of int to list of array
        Those stored later, by the number of their frame.

    """

    start: tuple[Sequence[Array], tuple[float, float], Backend]
    samples: dict[int, list[Array]]


@dataclass(frozen=True)
class Budget:
    """
    How much a filter is trained.

    Attributes
    ----------
    name : str
        For table and picture.
    changes : dict of str to int
        Of the learning configuration.

    """

    name: str
    changes: dict[str, int]


def budgets(config: LearningConfig) -> list[Budget]:
    """Return the budget of a configuration, that of the paper, and one that converges last."""
    own = {name: getattr(config, name) for name in CONVERGED}
    return [Budget(_describe(changes), changes) for changes in (own, PAPER, CONVERGED)]


def _describe(budget: dict[str, int]) -> str:
    """Return a budget in words."""
    interval = budget['update_interval']
    return (f'{budget["iterations"]} x {budget["gradient_steps"]} steps every '
            f'{"frame" if interval == 1 else f"{interval} frames"}')


def record_lesson(config: TrackerConfig, clip: Clip) -> Lesson:
    """Track through a clip; return every sample that the tracker stored."""
    starts: list[tuple] = []
    stored: list[list[Array]] = []

    class Recorder(StructuredOperator):
        """The filter of the tracker, which keeps what it is given."""

        def __init__(self, learning: LearningConfig, *start: Any) -> None:
            starts.append(start)
            super().__init__(learning, *start)

        def remember(self, sample: Sequence[Array]) -> None:
            """Store a sample."""
            stored.append([1 * block for block in sample])
            super().remember(sample)

    samples = {}
    tracker = LMSCOTracker(config)
    with patch.object(detector, 'StructuredOperator', Recorder):
        tracker.initialize(clip.frames[0], clip.start)
    for number, frame in enumerate(clip.frames[1:], start=1):
        known = len(stored)
        tracker.update(frame)
        tracker.learn()
        if len(stored) > known:
            samples[number] = stored[-1]
    return Lesson(starts[0], samples)


def follow(lesson: Lesson, config: LearningConfig) -> np.ndarray:
    """
    Return the objective of a filter after each sample.

    Parameters
    ----------
    lesson : Lesson
        The samples.
    config : LearningConfig
        Loss and budget.

    Returns
    -------
    ndarray, shape (n,)
        At the filter that would look for the target in the next frame.

    """
    operator = StructuredOperator(config, *lesson.start)
    values = []
    for number, sample in lesson.samples.items():
        operator.remember(sample)
        if number % config.update_interval == 0:
            operator.train()
        values.append(operator.objective())
    return np.array(values)


def compare(lesson: Lesson, config: LearningConfig) -> dict[tuple[str, str], np.ndarray]:
    """Return the objective of every loss and budget, shape (n,)."""
    return {(loss, budget.name): follow(lesson, replace(config, **changes, **budget.changes))
            for loss, changes in LOSSES.items() for budget in budgets(config)}


def objective_table(values: dict[tuple[str, str], np.ndarray]) -> str:
    """Return the objectives, and what they are over those of the converged filters."""
    rows = []
    for (loss, budget), objective in values.items():
        ratio = objective / values[loss, _describe(CONVERGED)]
        rows.append((loss, budget, f'{np.median(objective):.4g}', f'{np.median(ratio):.3f}',
                     f'{np.percentile(ratio, 90):.3f}', f'{ratio.max():.3f}'))
    return markdown_table(('loss', 'training', 'median objective', 'median over converged',
                           '90th percentile', 'highest'), rows)


def draw(values: dict[tuple[str, str], np.ndarray], numbers: Sequence[int], frames: int,
         title: str, path: Path) -> None:
    """
    Write a picture with axes for each loss and a line for each budget.

    Parameters
    ----------
    values : dict of ndarray, shape (n,)
        As `compare` returns them.
    numbers : sequence of int
        Frame of each sample; lines have gaps where none was stored.
    frames : int
        Number of the last frame.
    title : str
        What was followed.
    path : Path
        Of the picture.

    """
    figure = Figure(figsize=(10, 3.6), dpi=110, layout='constrained')
    columns = figure.subplots(1, len(LOSSES), sharex=True, sharey=True)
    converged = _describe(CONVERGED)
    shown = {budget for _, budget in values} - {converged}
    for axes, loss in zip(columns, LOSSES):
        style_axes(axes, loss, 'frame', '')
        axes.axhline(1, color='black', linewidth=1, label=converged)
        for budget, look in looks(sorted(shown)).items():
            ratio = np.full(frames + 1, np.nan)
            ratio[numbers] = values[loss, budget] / values[loss, converged]
            axes.plot(ratio, color=look.color, linewidth=1.2, label=budget)
    columns[0].set_ylabel(f'objective over converged, {title}', fontsize=9)
    columns[0].set_yscale('log')
    columns[0].yaxis.set_major_locator(LogLocator(subs=_TICKS))
    columns[0].yaxis.set_major_formatter('{x:g}')
    columns[0].yaxis.set_minor_locator(NullLocator())
    columns[-1].legend(fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def chosen_clip(options: argparse.Namespace) -> Clip:
    """Return the clip that the command line asks for."""
    if options.sequence is None:
        return walking_scene(options.frames + 1)
    group, name = options.sequence.parts[-2:]
    request = Request(options.sequence.parents[1], f'{group}/{name}', options.frames + 1)
    return next(recorded_clips(request))


def main(arguments: list[str] | None = None) -> None:
    """Print the table and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--config', default='default', help='preset or YAML file')
    parser.add_argument('--sequence', type=Path, help='folder DATASET/GROUP/NAME; '
                        'without it a scene is rendered')
    parser.add_argument('--frames', type=positive, default=300)
    parser.add_argument('--output', type=Path, default=Path('output/objective.png'))
    options = parser.parse_args(arguments)
    config, clip = named_config(options.config), chosen_clip(options)
    lesson = record_lesson(config, clip)
    if not lesson.samples:
        parser.exit(1, 'the tracker stored no sample\n')
    values = compare(lesson, config.learning)
    print(f'`{options.config}`, {clip.name}, {len(lesson.samples)} samples of '
          f'{len(clip.frames) - 1} frames\n\n{objective_table(values)}')
    draw(values, list(lesson.samples), len(clip.frames) - 1, clip.name, options.output)


if __name__ == '__main__':
    main()
