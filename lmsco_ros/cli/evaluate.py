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

from collections.abc import Iterator
from contextlib import closing, contextmanager
from enum import Enum
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from lmsco_ros.cli.console import (
    fail, frame_progress, MISUSED, plain_errors, say, show_table, telling_what_is_kept, warn)
from lmsco_ros.cli.options import MOST_FRAMES
from lmsco_ros.extras import require_extra

if TYPE_CHECKING:
    from lmsco_ros.evaluation.datasets.parts import AnchorPlan
    from lmsco_ros.evaluation.runner import Evaluation
    from lmsco_ros.evaluation.session import Selection
    from lmsco_ros.evaluation.worker_pool import Job, Outcome


class Protocol(str, Enum):
    """How trackers are run."""

    OPE = 'ope'
    VOT = 'vot'
    ANCHORS = 'anchors'


SplitOption = Annotated[Path | None, typer.Option(
    exists=True, dir_okay=False, show_default=False,
    help='YAML file of a split of the dataset: names of sequences by part and group.')]


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(evaluate)
    app.command()(results)


def evaluate(
    dataset: Annotated[Path, typer.Argument(
        show_default=False,
        help='Folder of a VOT, OTB, PTB-TIR, LSOTB-TIR, LaSOT, GOT-10k, TrackingNet, Anti-UAV or '
             'video dataset; docs/datasets.md shows them.')],
    output: Annotated[Path, typer.Option(
        file_okay=False, show_default=False,
        help='Folder for records, plots and report.html; finished work in it is kept.')],
    tracker: Annotated[list[str] | None, typer.Option(
        show_default='all that work here',
        help='Preset, config:FILE (YAML), csrt, kcf, mil, mosse, medianflow, '
             'nanotrack:BACKBONE,HEAD, vittrack:NET, trax:NAME=COMMAND or '
             'python:MODULE:CALLABLE. For the peers of OpenCV, images of more than 8 bits are '
             'stretched from the 1st to the 99th percentile of the image of each start. '
             'May be repeated.')] = None,
    protocol: Annotated[Protocol, typer.Option(
        help='ope: one pass; vot: start again after each failure; anchors: start at several '
             'frames of each sequence.')] = Protocol.OPE,
    every: Annotated[int | None, typer.Option(
        min=1, show_default='50', help='anchors: frames from one start to the next.')] = None,
    length: Annotated[int | None, typer.Option(
        min=2, show_default='to the end or back to the beginning, whichever is farther',
        help='anchors: track N frames forward from each start.')] = None,
    sequences: Annotated[str, typer.Option(
        help='Pattern of names, such as "vot_tir/*" or "bird*".')] = '*',
    frames: Annotated[int | None, typer.Option(
        min=2, max=MOST_FRAMES, show_default=False,
        help='Only the first N frames of each sequence.')] = None,
    jobs: Annotated[int, typer.Option(
        min=1, help='Number of single-threaded processes.')] = 1,
    split: SplitOption = None,
    part: Annotated[str, typer.Option(help='Part of the split that is evaluated.')] = 'test',
    challenge: Annotated[list[str] | None, typer.Option(
        show_default='the sequences as they are',
        help='Make the sequences harder: disappear_1s, disappear_3s, leave, leave_edge, cut, '
             'cut_other_view, twin, twin_crosses, twin_remains, camouflage, shutter, gain_jump, '
             'noise_step, contrast_step, stretch_step, polarity, dead_pixels, telemetry, nan, '
             'text, sixteen_bit, start_on_background, start_on_noise or all. '
             'May be repeated.')] = None,
) -> None:
    """Run trackers over a dataset and report accuracy, robustness and speed."""
    with plain_errors():
        require_extra('eval', '`lmsco evaluate`')
    from lmsco_ros.evaluation.challenges import challenge_names
    from lmsco_ros.evaluation.runner import Evaluation
    from lmsco_ros.evaluation.session import (
        build_trackers, buildable_trackers, describe, Request, select_sequences)
    from lmsco_ros.evaluation.whole_file import alone_in

    with plain_errors():
        with _misuse():
            request = Request(dataset, sequences, frames, split, part,
                              challenge_names(challenge or []),
                              _anchors(protocol, every, length))
            trackers, unavailable = (
                (build_trackers(tracker), ()) if tracker else buildable_trackers())
            for reason in unavailable:
                warn(f'left out: {reason}')
            selection = select_sequences(request)
        evaluation = Evaluation(trackers, selection.sequences, protocol.value, output)
        for reason in evaluation.damaged:
            warn(f'{reason}; it is made again')
        with telling_what_is_kept(lambda: _kept(evaluation, output)):
            _run(evaluation, jobs)
            skipped = [*selection.broken, *evaluation.skipped]
            for item in skipped:
                warn(f'skipped {item.name}: {item.reason}')
            with alone_in(output):
                evaluation.finish(describe(request, jobs, skipped))
                page = _report(output, selection)
        _tell_starts(output, protocol)
        say(f'report: {page}')


def results(
    folders: Annotated[list[Path], typer.Argument(
        show_default=False, help='Output folders of `lmsco evaluate`, on the same sequences.')],
    page: Annotated[Path, typer.Option(
        dir_okay=False, help='Markdown file to write.')] = Path('docs/results.md'),
    split: SplitOption = None,
) -> None:
    """Write the tables of evaluations as one Markdown page."""
    with plain_errors():
        require_extra('eval', '`lmsco results`')
    from lmsco_ros.evaluation.results_page import results_page
    from lmsco_ros.evaluation.split import load_split
    from lmsco_ros.evaluation.whole_file import write_whole

    with plain_errors():
        with _misuse():
            known = load_split(split) if split else None
        write_whole(page, results_page(folders, known).encode())
        say(f'results: {page}')


@contextmanager
def _misuse() -> Iterator[None]:
    """Leave as after misuse where a command asks for what is not there."""
    from lmsco_ros.evaluation.errors import RequestError, TrackerError

    try:
        yield
    except (RequestError, TrackerError) as error:
        fail(str(error), MISUSED)


def _anchors(protocol: Protocol, every: int | None,
             length: int | None) -> AnchorPlan | None:
    """Return where trackers are started under the protocol of several starts."""
    from lmsco_ros.evaluation.datasets.parts import ANCHOR_SPACING, AnchorPlan

    if protocol is Protocol.ANCHORS:
        return AnchorPlan(every or ANCHOR_SPACING, length)
    if every is not None or length is not None:
        fail('--every and --length say where several starts are; they go with '
             '--protocol anchors', MISUSED)
    return None


def _tell_starts(output: Path, protocol: Protocol) -> None:
    """Show the figures of several starts."""
    from lmsco_ros.evaluation.report.tables import anchor_overview
    from lmsco_ros.evaluation.run_file import read_run
    from lmsco_ros.evaluation.summaries.anchors import summarize_anchors

    run = read_run(output, protocol.value) if protocol is Protocol.ANCHORS else None
    if run is not None:
        table = anchor_overview(summarize_anchors(run))
        show_table(['tracker', *table.columns],
                   [[row.tracker, *(cell.text for cell in row.cells)] for row in table.rows])


def _kept(evaluation: Evaluation, output: Path) -> str:
    """Return what is kept of an evaluation that is broken off, and how it goes on."""
    total = len(evaluation.done) + len(evaluation.pending)
    return (f'{evaluation.finished} of {total} results are kept in {output}; the same command '
            'goes on from there')


def _report(output: Path, selection: Selection) -> Path:
    """Write the report on all protocols that have been run into the folder."""
    from lmsco_ros.evaluation.errors import ResultError
    from lmsco_ros.evaluation.report.page import write_report
    from lmsco_ros.evaluation.run_file import read_runs

    runs, complaints = read_runs(output)
    if not runs:
        raise ResultError('; '.join(complaints))
    for complaint in complaints:
        warn(f'not in the report: {complaint}')
    return write_report(output, runs, {
        item.full_name: item for item in (*selection.wholes, *selection.sequences)})


def _run(evaluation: Evaluation, jobs: int) -> None:
    if evaluation.done:
        say(f'{len(evaluation.done)} results are there already, '
            f'{len(evaluation.pending)} to go')
    if not evaluation.pending:
        return
    with closing(evaluation.run(jobs)) as outcomes, frame_progress() as progress:
        total = sum(len(job.sequence) for job in evaluation.pending)
        task = progress.add_task('evaluating', total=total)
        for job, outcome in outcomes:
            progress.advance(task, len(job.sequence))
            progress.console.print(_line(job, outcome), highlight=False, markup=False)


def _line(job: Job, outcome: Outcome) -> str:
    """Return what there is to say about a job that is done."""
    from lmsco_ros.evaluation.worker_pool import Unreadable

    where = f'{job.tracker.name:<12} {job.sequence.full_name:<28}'
    if isinstance(outcome, Unreadable):
        return f'{where} skipped: {outcome.reason}'
    rate = outcome.updates / outcome.wall_seconds if outcome.wall_seconds else 0.0
    failures = f', failures: {len(outcome.failures)}' if outcome.failures else ''
    crash = f', crashed: {outcome.error}' if outcome.error else ''
    return f'{where} {rate:7.1f} frames/s{failures}{crash}'
