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

"""`lmsco evaluate` and `lmsco results`: figures that a reader can repeat."""

from __future__ import annotations

from datetime import date
from enum import Enum
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Iterator, Optional

from rich.console import Console
from rich.progress import (
    BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn)
import typer

from lmsco_ros.evaluation.datasets import BrokenSequence, scan_dataset, TrackingSequence
from lmsco_ros.evaluation.environment import machine, versions
from lmsco_ros.evaluation.errors import EvaluationError
from lmsco_ros.evaluation.runner import Evaluation
from lmsco_ros.evaluation.split import load_split
from lmsco_ros.evaluation.trackers import available_names, resolve, TrackerSpec
from lmsco_ros.evaluation.worker_pool import Job, Outcome


class Protocol(str, Enum):
    """How trackers are run."""

    OPE = 'ope'
    VOT = 'vot'


class Part(str, Enum):
    """Part of the fixed split."""

    TEST = 'test'
    TRAIN = 'train'


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(evaluate)


def evaluate(
    dataset: Path = typer.Argument(
        ..., help='Folder of a VOT, OTB, PTB-TIR, LSOTB-TIR, Anti-UAV or video dataset.'),
    output: Path = typer.Option(
        ..., help='Folder for records, figures and report; finished work in it is kept.'),
    tracker: Optional[list[str]] = typer.Option(
        None, help='Preset, OpenCV tracker (csrt, kcf, mil, mosse, medianflow, '
                   'nanotrack:BACKBONE,HEAD, vit:NET), trax:NAME=COMMAND or '
                   'python:MODULE:CALLABLE; may be repeated. Default: all that work here.'),
    protocol: Protocol = typer.Option(
        Protocol.OPE, help='ope: one pass; vot: start again after each failure.'),
    sequences: str = typer.Option('*', help='Pattern of names, such as "vot_tir/*" or "bird*".'),
    frames: Optional[int] = typer.Option(None, min=2, help='Only the first N frames of each.'),
    jobs: int = typer.Option(1, min=1, help='Number of single-threaded processes.'),
    split: Optional[Part] = typer.Option(
        None, help='Only this part of the fixed split of thermal_dev.'),
) -> None:
    """Run trackers over a dataset and report accuracy, robustness and speed."""
    console = Console(stderr=True)
    try:
        specs = _trackers(tracker or list(available_names()))
        chosen, broken = _sequences(dataset, sequences, frames, split)
        evaluation = Evaluation(specs, chosen, protocol.value, output)
        _run(evaluation, jobs, console)
        skipped = [*broken, *evaluation.skipped]
        evaluation.finish(_context(dataset, specs, sequences, frames, split, jobs, skipped))
    except EvaluationError as error:
        console.print(f'[red]error:[/] {error}', highlight=False)
        raise typer.Exit(2) from error
    for item in skipped:
        console.print(f'[yellow]skipped[/] {item.name}: {item.reason}', highlight=False)


def _trackers(names: list[str]) -> list[TrackerSpec]:
    """Return the trackers in the order given, each of them known to work here."""
    specs = [resolve(name) for name in dict.fromkeys(names)]
    for spec in specs:
        spec.build().close()
    return specs


def _sequences(dataset: Path, pattern: str, frames: Optional[int], split: Optional[Part],
               ) -> tuple[list[TrackingSequence], list[BrokenSequence]]:
    """Return what is to be evaluated, and what would be if it were not broken."""
    scan = scan_dataset(dataset)
    chosen = [item for item in scan.sequences if _matches(item.full_name, pattern)]
    broken = [item for item in scan.broken if _matches(item.name, pattern)]
    if split is not None:
        fixed = load_split()
        chosen = fixed.select(split.value, chosen)
        broken = [item for item in broken if item.name in fixed.parts[split.value]]
    if not chosen:
        raise EvaluationError(f'no usable sequence in {dataset} matches {pattern!r}'
                              + ''.join(f'\n  {item.name}: {item.reason}' for item in broken))
    return [item.first(frames) if frames else item for item in chosen], broken


def _matches(full_name: str, pattern: str) -> bool:
    return fnmatch(full_name, pattern) or fnmatch(full_name.rpartition('/')[2], pattern)


def _run(evaluation: Evaluation, jobs: int, console: Console) -> None:
    columns = (TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(),
               TextColumn('frames'), TimeElapsedColumn(), TimeRemainingColumn())
    if evaluation.done:
        console.print(f'{len(evaluation.done)} results are there already, '
                      f'{len(evaluation.pending)} to go')
    with Progress(*columns, console=console) as progress:
        total = sum(len(job.sequence) for job in evaluation.pending)
        task = progress.add_task('evaluating', total=total)
        for job, outcome in evaluation.run(jobs):
            progress.advance(task, len(job.sequence))
            console.print(_line(job, outcome), highlight=False)


def _line(job: Job, outcome: Outcome) -> str:
    """Return what there is to say about a job that is done."""
    where = f'{job.tracker.name:<12} {job.sequence.full_name:<28}'
    return f'{where} {"; ".join(_remarks(outcome))}'


def _remarks(outcome: Outcome) -> Iterator[str]:
    if not hasattr(outcome, 'updates'):
        yield f'[yellow]skipped[/] {outcome.reason}'
        return
    if outcome.wall_seconds > 0:
        yield f'{outcome.updates / outcome.wall_seconds:7.1f} frames/s'
    if outcome.failures:
        yield f'{len(outcome.failures)} failures'
    if outcome.error:
        yield f'[red]crashed[/] {outcome.error}'


def _context(dataset: Path, specs: list[TrackerSpec], pattern: str, frames: Optional[int],
             split: Optional[Part], jobs: int, skipped: list[BrokenSequence]) -> dict[str, Any]:
    return {
        'dataset': dataset.resolve().name, 'sequences': pattern, 'frames': frames,
        'split': split.value if split else None, 'jobs': jobs,
        'trackers': [spec.name for spec in specs], 'date': date.today().isoformat(),
        'machine': machine(), 'versions': dict(versions()),
        'skipped': [{'name': item.name, 'reason': item.reason} for item in skipped],
    }
