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

"""Tables of figures, ready to be written as HTML or as Markdown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Generic, Literal, TypeVar

from lmsco_ros.evaluation.protocols.bootstrap import Estimate
from lmsco_ros.evaluation.protocols.calibration import BINS
from lmsco_ros.evaluation.protocols.per_attribute import AttributeFigures
from lmsco_ros.evaluation.report.formatting import interval, number, signed
from lmsco_ros.evaluation.summaries.anchors import AnchorSummary, StartFigures
from lmsco_ros.evaluation.summaries.benchmarks import BenchmarkSummary
from lmsco_ros.evaluation.summaries.confidence import ConfidenceSummary
from lmsco_ros.evaluation.summaries.consistency import ConsistencySummary, ErrorFigures
from lmsco_ros.evaluation.summaries.differences import Difference
from lmsco_ros.evaluation.summaries.one_pass import OnePassSummary
from lmsco_ros.evaluation.summaries.score import ScoreSummary
from lmsco_ros.evaluation.summaries.starts import StartSummary
from lmsco_ros.evaluation.summaries.supervised import SupervisedSummary

Summary = TypeVar('Summary', OnePassSummary, SupervisedSummary, AnchorSummary, ConfidenceSummary,
                  ScoreSummary, StartSummary, ConsistencySummary, BenchmarkSummary)


@dataclass(frozen=True)
class Cell:
    """A figure as text, its interval, and whether it is the best of its column."""

    text: str
    range: str = ''
    best: bool = False


@dataclass(frozen=True)
class Row:
    """The figures of one tracker; `bar` is what the page draws beside its name."""

    tracker: str
    cells: tuple[Cell, ...]
    bar: Estimate | None = None


@dataclass(frozen=True)
class Table:
    """Column titles and rows."""

    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def bars(self) -> bool:
        """Whether rows have a bar."""
        return any(row.bar is not None for row in self.rows)


@dataclass(frozen=True)
class DifferenceRow:
    """One tracker against the reference."""

    tracker: str
    reference: str
    cell: Cell
    better: int
    worse: int


@dataclass(frozen=True)
class _Column(Generic[Summary]):
    """
    How a column is made.

    Attributes
    ----------
    title : str
        Heading.
    estimate : callable
        The figure of a summary.
    decimals : int
        Digits after the point.
    direction : int
        +1 when higher is better, -1 when lower is, 0 when there is no better.
    ranged : bool
        Whether the interval is shown.

    """

    title: str
    estimate: Callable[[Summary], Estimate]
    decimals: int = 3
    direction: int = 1
    ranged: bool = True


def attribute_table(figures: Mapping[str, Mapping[str, AttributeFigures]],
                    counted: Literal['frames', 'failures'] = 'frames') -> Table:
    """
    Return the mean overlap on the frames of each attribute, and what is counted there.

    Parameters
    ----------
    figures : mapping of str to mapping
        For each tracker, those of each attribute.
    counted : {'frames', 'failures'}
        Which number stands with it.

    """
    rows = tuple(Row(tracker, tuple(
        Cell(number(item.mean_overlap), str(getattr(item, counted)))
        for item in known.values())) for tracker, known in figures.items())
    titles = tuple(name.replace('_', ' ') for name in next(iter(figures.values())))
    return Table(titles, rows)


def one_pass_table(summaries: Sequence[OnePassSummary]) -> Table:
    """Return the main table of a one-pass run."""
    columns: tuple[_Column[OnePassSummary], ...] = (
        _Column('success AUC', lambda item: item.success_auc),
        _Column('precision 5 px', lambda item: item.precision_5),
        _Column('precision 20 px', lambda item: item.precision_20),
        _Column('normalized precision', lambda item: item.normalized_auc),
        _Column('frames/s (processor)', lambda item: item.cpu_rate, 1, ranged=False),
        _Column('frames/s (clock)', lambda item: item.wall_rate, 1, ranged=False))
    return _table(columns, summaries, lambda item: item.success_auc)


def benchmark_table(summaries: Sequence[BenchmarkSummary]) -> Table:
    """Return the measures of single benchmarks."""
    columns: tuple[_Column[BenchmarkSummary], ...] = (
        _Column('AO (GOT-10k)', lambda item: item.average_overlap),
        _Column('SR .5', lambda item: item.success_50),
        _Column('SR .75', lambda item: item.success_75),
        _Column('normalized precision at .2 (LaSOT)',
                lambda item: item.normalized_precision_20),
        _Column('state accuracy (Anti-UAV)', lambda item: item.state_accuracy))
    if any(math.isfinite(item.maximum_success.value) for item in summaries):
        nearer: tuple[_Column[BenchmarkSummary], ...] = (
            _Column('MSR (RGBT234)', lambda item: item.maximum_success),
            _Column('MPR 20 px', lambda item: item.maximum_precision))
        columns += nearer
    return _table(columns, summaries, None)


def supervised_table(summaries: Sequence[SupervisedSummary]) -> Table:
    """Return the main table of a supervised run."""
    columns: tuple[_Column[SupervisedSummary], ...] = (
        _Column('EAO', lambda item: item.eao),
        _Column('EAO (Python toolkit)', lambda item: item.eao_python),
        _Column('accuracy', lambda item: item.accuracy),
        _Column('failures', lambda item: _plain(item.failures.sum()), 0, -1),
        _Column('of these at jumps', lambda item: _plain(item.at_jumps), 0, 0),
        _Column('failures per sequence', lambda item: item.failures_per_sequence, 2, -1),
        _Column('failures per 100 frames', lambda item: item.failures_per_100_frames, 2, -1),
        _Column('reliability', lambda item: item.reliability),
        _Column('accuracy rank', lambda item: _plain(item.accuracy_rank), 2, -1),
        _Column('robustness rank', lambda item: _plain(item.robustness_rank), 2, -1))
    return _table(columns, summaries, lambda item: item.eao)


def anchor_table(summaries: Sequence[AnchorSummary]) -> Table:
    """Return the main table of a run with several starts a sequence."""
    columns: tuple[_Column[AnchorSummary], ...] = (
        _Column('EAO', lambda item: item.eao),
        _Column('accuracy', lambda item: item.all_starts.accuracy),
        _Column('robustness', lambda item: item.all_starts.robustness),
        _Column('success AUC', lambda item: item.all_starts.success_auc),
        _Column('starts', lambda item: _plain(item.all_starts.starts), 0, 0),
        _Column('failures', lambda item: _plain(item.all_starts.failures), 0, -1))
    return _table(columns, summaries, lambda item: item.eao)


def border_table(summaries: Sequence[AnchorSummary]) -> Table:
    """Return the table of starts at the border of the image and of starts in view."""
    columns = (*_start_columns('entering', lambda item: item.entering),
               *_start_columns('in view', lambda item: item.in_view))
    return _table(columns, summaries, None)


def _start_columns(title: str, group: Callable[[AnchorSummary], StartFigures],
                   ) -> tuple[_Column[AnchorSummary], ...]:
    return (_Column(f'{title}: starts', lambda item: _plain(group(item).starts), 0, 0),
            _Column('success AUC', lambda item: group(item).success_auc),
            _Column('accuracy', lambda item: group(item).accuracy),
            _Column('robustness', lambda item: group(item).robustness))


def anchor_overview(summaries: Sequence[AnchorSummary]) -> Table:
    """Return the few figures of a run with several starts that a terminal has room for."""
    columns: tuple[_Column[AnchorSummary], ...] = (
        _Column('EAO', lambda item: item.eao),
        _Column('accuracy', lambda item: item.all_starts.accuracy),
        _Column('robustness', lambda item: item.all_starts.robustness),
        _Column('AUC entering', lambda item: item.entering.success_auc),
        _Column('AUC in view', lambda item: item.in_view.success_auc))
    return _table(columns, summaries, None)


def score_table(summaries: Sequence[ScoreSummary]) -> Table:
    """Return the table of scores."""
    columns: tuple[_Column[ScoreSummary], ...] = (
        _Column('AUROC of the score', lambda item: item.auroc),
        _Column('AUROC, mean of sequences', lambda item: item.mean_auroc),
        _Column('calibration error', lambda item: item.calibration_error, 3, -1))
    return _table(columns, summaries, None)


def reliability_table(summaries: Sequence[ScoreSummary]) -> Table | None:
    """Return the share of good frames by their score; None where no score is a probability."""
    rows = [Row(item.tracker, tuple(
        Cell(number(share), f'{number(score)}, {count:.0f}' if count else '')
        for share, score, count in zip(item.calibration.shares, item.calibration.mean_scores,
                                       item.calibration.frames)))
            for item in summaries if item.calibration.frames.any()]
    titles = tuple(f'{number(index / BINS, 1)} – {number((index + 1) / BINS, 1)}'
                   for index in range(BINS))
    return Table(titles, tuple(rows)) if rows else None


def start_table(summaries: Sequence[StartSummary]) -> Table | None:
    """Return the table of what was said soon after starts, None where none can be judged."""
    if not any(item.on_nothing or item.on_target for item in summaries):
        return None
    columns: tuple[_Column[StartSummary], ...] = (
        _Column('starts on nothing', lambda item: _plain(item.on_nothing), 0, 0),
        _Column('told within 30 frames', lambda item: _plain(item.told), 0),
        _Column('LOST', lambda item: _plain(item.lost), 0),
        _Column('starts on a target', lambda item: _plain(item.on_target), 0, 0),
        _Column('falsely told', lambda item: _plain(item.falsely_told), 0, -1),
        _Column('falsely LOST', lambda item: _plain(item.falsely_lost), 0, -1))
    return _table(columns, summaries, None)


def consistency_table(summaries: Sequence[ConsistencySummary]) -> Table | None:
    """Return the table of covariances, None where no tracker tells any."""
    columns = (*_error_columns('', lambda item: item.everywhere),
               *_error_columns('followed: ', lambda item: item.followed))
    return _table(columns, summaries, None) if summaries else None


def _error_columns(title: str, group: Callable[[ConsistencySummary], ErrorFigures],
                   ) -> tuple[_Column[ConsistencySummary], ...]:
    return (_Column(f'{title}frames', lambda item: _plain(group(item).frames), 0, 0),
            _Column('mean error²', lambda item: group(item).mean, 2, 0),
            _Column('factor', lambda item: _plain(group(item).factor), 2, 0),
            _Column('median', lambda item: _plain(group(item).median), 2, 0),
            _Column('within the 95 % ellipse', lambda item: group(item).inside, 3, 0))


def confidence_table(summaries: Sequence[ConfidenceSummary]) -> Table:
    """Return the table of LOST while the target is there."""
    columns: tuple[_Column[ConfidenceSummary], ...] = (
        _Column('false LOST per 1000 frames', lambda item: item.false_alarms, 2, -1),
        _Column('found again within 30 frames', lambda item: item.recovered_share),
        _Column('share of frames LOST', lambda item: item.lost_share, 3, 0))
    return _table(columns, summaries, None)


def absence_table(summaries: Sequence[ConfidenceSummary]) -> Table | None:
    """Return the table of targets that left and came back, None where none did."""
    if not any(item.departures or item.absent or item.returns for item in summaries):
        return None
    columns: tuple[_Column[ConfidenceSummary], ...] = (
        _Column('targets that left', lambda item: _plain(item.departures), 0, 0),
        _Column('LOST declared', lambda item: _plain(item.declared), 0),
        _Column('within 30 frames', lambda item: _plain(item.declared_soon), 0),
        _Column('median frames to LOST', lambda item: _plain(item.delay), 0, -1),
        _Column('share of absent frames claimed', lambda item: item.claimed_share, 3, -1),
        _Column('returns', lambda item: _plain(item.returns), 0, 0),
        _Column('found again', lambda item: item.found_share),
        _Column('median frames to that', lambda item: _plain(item.found_delay), 0, -1),
        _Column('returns with a claim elsewhere', lambda item: _plain(item.mistaken), 0, -1))
    return _table(columns, summaries, None)


def difference_rows(differences: Sequence[Difference], decimals: int) -> tuple[DifferenceRow, ...]:
    """Return one row for each difference; bold (`best`) where it is real."""
    return tuple(
        DifferenceRow(item.tracker, item.reference,
                      Cell(signed(item.difference, decimals),
                           interval(item.difference, decimals), item.real),
                      item.better, item.worse)
        for item in differences)


def _table(columns: Sequence[_Column[Summary]], summaries: Sequence[Summary],
           bar: Callable[[Summary], Estimate] | None) -> Table:
    best = [_best(column, summaries) for column in columns]
    rows = tuple(
        Row(tracker=summary.tracker, bar=bar(summary) if bar else None,
            cells=tuple(_cell(column, summary, target) for column, target in zip(columns, best)))
        for summary in summaries)
    return Table(tuple(column.title for column in columns), rows)


def _cell(column: _Column[Summary], summary: Summary, best: str) -> Cell:
    figure = column.estimate(summary)
    text = number(figure.value, column.decimals)
    return Cell(text, interval(figure, column.decimals) if column.ranged else '', text == best)


def _best(column: _Column[Summary], summaries: Sequence[Summary]) -> str:
    """Return the text of the best figure of a column, empty where there is no choice."""
    values = [column.estimate(summary).value for summary in summaries]
    known = [value for value in values if math.isfinite(value)]
    if len(known) < 2 or not column.direction or len(set(known)) == 1:
        return ''
    return number(max(known) if column.direction > 0 else min(known), column.decimals)


def _plain(value: float) -> Estimate:
    """Return a figure that has no interval."""
    return Estimate(float(value), float('nan'), float('nan'))
