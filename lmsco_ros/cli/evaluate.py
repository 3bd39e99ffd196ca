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

"""`lmsco evaluate`: figures that a reader can repeat."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from lmsco_ros.cli.console import (
    fail, frame_progress, misuse, MISUSED, plain_errors, say, show_table, telling_what_is_kept,
    warn)
from lmsco_ros.cli.evaluate_options import (
    ChallengeOption, DatasetArgument, EngineName, EngineOption, EveryOption, FramesOption,
    JobsOption, LengthOption, OutputOption, PartOption, Protocol, ProtocolOption, PublishedOption,
    PublishedTable, SchedulerOption, SequencesOption, ShardOption, SplitOption, TrackerOption)
from lmsco_ros.extras import require_extra

if TYPE_CHECKING:
    from lmsco_ros.evaluation.datasets.parts import AnchorPlan
    from lmsco_ros.evaluation.jobs import Engine, Job, Outcome
    from lmsco_ros.evaluation.published import PublishedFile
    from lmsco_ros.evaluation.runner import Evaluation
    from lmsco_ros.evaluation.session import Request, Selection
    from lmsco_ros.evaluation.trackers import TrackerSpec


def register(app: typer.Typer) -> None:
    """Add the command of this module to `app`."""
    app.command()(evaluate)


def evaluate(
    dataset: DatasetArgument, output: OutputOption, tracker: TrackerOption = None,
    protocol: ProtocolOption = Protocol.OPE, every: EveryOption = None,
    length: LengthOption = None, sequences: SequencesOption = '*', frames: FramesOption = None,
    jobs: JobsOption = None, engine: EngineOption = EngineName.LOCAL,
    scheduler: SchedulerOption = None, shard: ShardOption = None, split: SplitOption = None,
    part: PartOption = 'test', challenge: ChallengeOption = None,
    published: PublishedOption = None,
) -> None:
    """Run trackers over a dataset and report accuracy, robustness and speed."""
    with plain_errors():
        _require(engine)
        from lmsco_ros.evaluation.challenges import challenge_names
        from lmsco_ros.evaluation.runner import Evaluation
        from lmsco_ros.evaluation.session import Request, select_sequences, Shard

        with misuse():
            start = _engine(engine, scheduler, jobs)
            request = Request(dataset, sequences, frames, split, part,
                              challenge_names(challenge or []), _anchors(protocol, every, length),
                              Shard(*shard) if shard else None)
            peers = _published(published or [], frames)
            trackers = _trackers(tracker or [])
            selection = select_sequences(request)
        evaluation = Evaluation(trackers, selection.sequences, protocol.value, output)
        for reason in evaluation.damaged:
            warn(f'{reason}; it is made again')
        with telling_what_is_kept(lambda: _kept(evaluation, output)):
            context = _run(evaluation, request, selection, start)
            page = _finish(evaluation, selection, peers, context, output)
        _tell_starts(output, protocol)
        say(f'report: {page}')


def _require(engine: EngineName) -> None:
    """Tell of an extra that the command lacks."""
    require_extra('eval', '`lmsco evaluate`')
    if engine is EngineName.DASK:
        require_extra('cluster', '`lmsco evaluate --engine dask`')


EngineStart = Callable[[], AbstractContextManager['Engine']]


def _engine(name: EngineName, scheduler: str | None, jobs: int | None) -> EngineStart:
    """Return the function that starts who runs trackers, or leave after what makes no sense."""
    from lmsco_ros.evaluation.worker_pool import LocalProcesses

    if scheduler is not None and name is not EngineName.DASK:
        fail('--scheduler names a Dask cluster; it goes with --engine dask', MISUSED)
    if scheduler is not None and jobs is not None:
        fail('--jobs starts processes on this machine, and --scheduler uses workers that are '
             'there already; give one of them', MISUSED)
    if name is EngineName.DASK:
        return lambda: _cluster(scheduler, jobs or 1)
    return lambda: nullcontext(LocalProcesses(jobs or 1))


@contextmanager
def _cluster(scheduler: str | None, jobs: int) -> Iterator[Engine]:
    """Yield the engine of a Dask cluster and say where it can be watched."""
    from lmsco_ros.evaluation.cluster import cluster_at, local_cluster

    with cluster_at(scheduler) if scheduler else local_cluster(jobs) as cluster:
        say(f'cluster {cluster.address}, threads: {cluster.at_once}, '
            f'dashboard: {cluster.dashboard}')
        yield cluster


def _trackers(names: Sequence[str]) -> Sequence[TrackerSpec]:
    """Return the trackers of these names, or without any all that work here."""
    from lmsco_ros.evaluation.session import build_trackers, buildable_trackers

    if names:
        return build_trackers(names)
    trackers, unavailable = buildable_trackers()
    for reason in unavailable:
        warn(f'left out: {reason}')
    return trackers


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


def _published(tables: Sequence[PublishedTable], frames: int | None) -> list[PublishedFile]:
    """Return the figures of others that stand beside those that are made here."""
    from lmsco_ros.evaluation.published import read_published

    if tables and frames is not None:
        fail('published figures are of whole sequences; leave out --frames or --published',
             MISUSED)
    return [read_published(*table) for table in tables]


def _run(evaluation: Evaluation, request: Request, selection: Selection,
         start: EngineStart) -> dict[str, object]:
    """Run what is to be run, and return the conditions of that for the run file."""
    from lmsco_ros.evaluation.session import describe
    from lmsco_ros.evaluation.worker_pool import LocalProcesses

    if evaluation.done:
        say(f'{len(evaluation.done)} results are there already, '
            f'{len(evaluation.pending)} to go')
    with start() if evaluation.pending else nullcontext(LocalProcesses()) as engine:
        if evaluation.pending:
            _show(evaluation, engine)
        skipped = [*selection.broken, *evaluation.skipped]
        for item in skipped:
            warn(f'skipped {item.name}: {item.reason}')
        return describe(request, engine, skipped)


def _show(evaluation: Evaluation, engine: Engine) -> None:
    """Run what is to be run and say what comes of it."""
    with closing(evaluation.run(engine)) as outcomes, frame_progress() as progress:
        total = sum(len(job.sequence) for job in evaluation.pending)
        task = progress.add_task('evaluating', total=total)
        for job, outcome in outcomes:
            progress.advance(task, len(job.sequence))
            progress.console.print(_line(job, outcome), highlight=False, markup=False)


def _line(job: Job, outcome: Outcome) -> str:
    """Return what there is to say about a job that is done."""
    from lmsco_ros.evaluation.jobs import LeftOut

    where = f'{job.tracker.name:<12} {job.sequence.full_name:<28}'
    if isinstance(outcome, LeftOut):
        return f'{where} skipped: {outcome.reason}'
    rate = outcome.updates / outcome.wall_seconds if outcome.wall_seconds else 0.0
    failures = f', failures: {len(outcome.failures)}' if outcome.failures else ''
    crash = f', crashed: {outcome.error}' if outcome.error else ''
    return f'{where} {rate:7.1f} frames/s{failures}{crash}'


def _finish(evaluation: Evaluation, selection: Selection, published: Sequence[PublishedFile],
            context: dict[str, object], output: Path) -> Path:
    """Write the run file, and the report on all protocols that have been run into the folder."""
    from lmsco_ros.evaluation.errors import ResultError
    from lmsco_ros.evaluation.report.page import write_report
    from lmsco_ros.evaluation.run_file import read_runs
    from lmsco_ros.evaluation.whole_file import alone_in

    with alone_in(output):
        evaluation.finish(context)
        runs, complaints = read_runs(output)
        if not runs:
            raise ResultError('; '.join(complaints))
        for complaint in complaints:
            warn(f'not in the report: {complaint}')
        return write_report(output, runs, {
            item.full_name: item for item in (*selection.wholes, *selection.sequences)}, published)


def _kept(evaluation: Evaluation, output: Path) -> str:
    """Return what is kept of an evaluation that is broken off, and how it goes on."""
    total = len(evaluation.done) + len(evaluation.pending)
    return (f'{evaluation.finished} of {total} results are kept in {output}; the same command '
            'goes on from there')


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
