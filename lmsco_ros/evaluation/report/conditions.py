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

"""Under which conditions figures were made: what a reader needs to repeat them."""

from __future__ import annotations

from collections.abc import Mapping
import shlex

from lmsco_ros.evaluation.run_file import EvaluationRun
from lmsco_ros.evaluation.trackers.opencv_image import STRETCHING
from lmsco_ros.evaluation.trackers.registry import EIGHT_BIT_NAMES, name_with_files


def command_line(run: EvaluationRun) -> str:
    """Return the command that makes the run, with the dataset by its folder's name."""
    context = run.context
    words = ['lmsco', 'evaluate', str(context.get('dataset', 'DATASET')),
             '--protocol', run.protocol]
    plan = context.get('anchors') or {}
    options = {'split': context.get('split'), 'part': context.get('part'),
               'frames': context.get('frames'),
               'shard': context.get('shard'),
               'every': plan.get('spacing'), 'length': plan.get('length')}
    for option, value in options.items():
        if value:
            words += [f'--{option}', str(value)]
    if context.get('sequences', '*') != '*':
        words += ['--sequences', context['sequences']]
    for name in context.get('challenges', ()):
        words += ['--challenge', name]
    for name in run.trackers:
        words += ['--tracker', name_with_files(name)]
    words += ['--jobs', str(context.get('jobs', 1)), '--output', 'results']
    return shlex.join(words)


def extent(run: EvaluationRun) -> str:
    """Return how much was evaluated: sequences, starts where there are several, frames."""
    sequences, starts = len(run.wholes), len(run.sequences)
    frames = sum(len(sequence.ground_truth) for sequence in run.sequences)
    several = f'{starts} starts, ' if run.protocol == 'anchors' else ''
    return f'{sequences} sequences, {several}{frames} frames'


def conditions(runs: Mapping[str, EvaluationRun]) -> list[tuple[str, str]]:
    """Return pairs of a heading and what holds for the runs."""
    main = next(iter(runs.values()))
    machine = main.context.get('machine', {})
    pairs = [('command', command_line(run)) for run in runs.values()]
    pairs.append(('date', str(main.context.get('date', 'unknown'))))
    pairs.append(('machine', f'{machine.get("processor", "unknown")}, '
                             f'{machine.get("cores", "?")} cores; one thread a tracker, '
                             f'{main.context.get("jobs", 1)} at a time'))
    pairs.append(('versions', ', '.join(
        f'{name} {version}' for name, version in main.context.get('versions', {}).items())))
    stretched = [name for name in _trackers(runs) if name in EIGHT_BIT_NAMES]
    if stretched:
        pairs.append(('images', f'for {", ".join(stretched)}, {STRETCHING}'))
    pairs.append(('sequences', ', '.join(whole.full_name for whole in main.wholes)))
    return pairs


def _trackers(runs: Mapping[str, EvaluationRun]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for run in runs.values() for name in run.trackers))


def problems(runs: Mapping[str, EvaluationRun]) -> list[str]:
    """Return a sentence for each sequence that was skipped and each tracker that crashed."""
    skipped = {f'skipped {item["name"]}: {item["reason"]}': None
               for run in runs.values() for item in run.context.get('skipped', ())}
    crashed = [f'{name} crashed on {crash} ({run.protocol})'
               for run in runs.values() for name in run.trackers for crash in run.crashes(name)]
    return [*skipped, *crashed]
