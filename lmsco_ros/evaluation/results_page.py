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

"""`docs/results.md`: the tables of one or more evaluations as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from lmsco_ros.evaluation.challenges import CHALLENGES
from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.merging import merged_run
from lmsco_ros.evaluation.published import (
    published_note, PublishedFile, summarize_published)
from lmsco_ros.evaluation.report.conditions import conditions, extent, problems
from lmsco_ros.evaluation.report.formatting import spread_warning
from lmsco_ros.evaluation.report.tables import (
    absence_table, anchor_table, attribute_table, benchmark_table, border_table, Cell,
    confidence_table, consistency_table, difference_rows, DifferenceRow, one_pass_table,
    score_table, start_table, supervised_table, Table)
from lmsco_ros.evaluation.run_file import EvaluationRun
from lmsco_ros.evaluation.split import Split
from lmsco_ros.evaluation.summaries.anchors import anchor_interval, summarize_anchors
from lmsco_ros.evaluation.summaries.attributes import attribute_source, summarize_attributes
from lmsco_ros.evaluation.summaries.benchmarks import summarize_benchmarks
from lmsco_ros.evaluation.summaries.confidence import summarize_confidence
from lmsco_ros.evaluation.summaries.consistency import summarize_consistency
from lmsco_ros.evaluation.summaries.differences import differences
from lmsco_ros.evaluation.summaries.one_pass import summarize_one_pass
from lmsco_ros.evaluation.summaries.score import size_note, summarize_scores
from lmsco_ros.evaluation.summaries.starts import summarize_starts
from lmsco_ros.evaluation.summaries.supervised import eao_interval, summarize_supervised

_INTRODUCTION = """\
# Results

Written by `lmsco results`; do not change by hand.

Brackets hold 95 % bootstrap intervals over sequences; bold is the best of a column.

EAO is taken over these sequences; where they are not those of a VOT challenge, it compares
within this page only.
"""

_ONE_PASS_NOTE = """\
Started once on the first frame and never helped again. Success AUC over 21 overlap
thresholds; precision is the share of frames with a center error of at most 5 or 20
pixels; normalized precision the mean share within 0 to 0.5 target sizes. Frames per
second for one thread: of processor time, and on the clock with as many evaluations side
by side as the conditions say.
"""

_BENCHMARK_NOTE = """\
Measures of single benchmarks. AO is the mean overlap and SR the share of frames above an
overlap of .5 and .75, over the frames of all sequences but the first ones, of what lies in
the image (GOT-10k). Normalized precision at .2 is the share of frames with a center error
of at most .2 target sizes (LaSOT). State accuracy is the mean of the overlap where the target
is there, and of 1 where it is not and the tracker says so (Anti-UAV). MSR and MPR, where there
are two channels, are success AUC and precision by the boxes of that one that the tracker is
nearer to (RGBT234).
"""

_ATTRIBUTE_NOTE = """\
Mean overlap on the frames of each attribute, pooled over sequences, with the number of frames.
"""

_SUPERVISED_NOTE = """\
Started again five frames after each frame without overlap. Accuracy without the ten
frames after each start, weighted by sequence length; reliability is the chance to
survive 30 frames. At a jump the target moves by more than two of its sizes in one frame, as
where a recording is cut: a search near the last place must fail there. EAO is the
mean of the expected-overlap curve over sequence lengths of {low} to {high} frames, the
curve followed to the longest sequence (MATLAB toolkit). The figure of the Python toolkit,
whose curve ends at the tracker's own longest fragment and which so overrates trackers that
fail early, stands beside it.
"""

_ANCHORS_NOTE = """\
Started on frames along each sequence and never helped again, as in the VOT challenges since
2020. A tracker has failed where its overlap falls to .1 and does not rise above that within
ten frames. Robustness is the share of frames before that, accuracy the mean overlap on them
without the start; EAO is the mean of the expected-overlap curve over {low} to {high} frames,
with overlap 0 after a failure. Success AUC is the mean over the starts, of all frames. A
target enters when its first box touches the border of the image; all other starts are in
view.
"""

_CONFIDENCE_NOTE = """\
AUROC is the chance that a frame with an overlap above one half has a higher score than
one without; 0.5 is guessing. The calibration error is the mean distance between the score and
the share of such frames, over ten parts of its range; frames without the target count as
not covered. LOST is false when it is declared on a target that is there and was covered by
more than half one frame before; it is found again when a box covers it so within 30 frames.
"""

_START_NOTE = """\
A start is told to be on nothing when most of the 30 frames after it have a score below one
half or are LOST.
"""

_CONSISTENCY_NOTE = """\
Squared error of the predicted center as a multiple of what the covariance says. The mean is 2
where that is right, within {low:.2f} – {high:.2f} for so many sequences at 95 %; the median
is 1.39. The factor is what the covariance would have to be multiplied with. In frames that are
followed, a box was claimed that touches the target.
"""

_ABSENCE_NOTE = """\
Frames without the target are claimed when a box is given and the state is not LOST. A
target returns after an absence, or by a jump of more than two of its sizes, and stays for
30 frames at least; it is found again when within these a box covers it by more than half
and the state is not LOST. Boxes without any overlap before that are claims elsewhere.
"""


def results_page(folders: Sequence[Path], split: Split | None = None,
                 published: Sequence[PublishedFile] = ()) -> str:
    """
    Return the tables of evaluation folders as Markdown.

    Parameters
    ----------
    folders : sequence of Path
        Outputs of `lmsco evaluate`; trackers and sequences of several folders come into one
        table.
    split : Split, optional
        Tells of the dataset, and which groups have chapters of their own.
    published : sequence of PublishedFile, optional
        Figures of others that stand beside those of the one-pass run.

    Raises
    ------
    DatasetError
        When no folder holds a run, or a tracker lacks a sequence that another one has.

    """
    runs = {protocol: run for protocol in PROTOCOLS
            if (run := merged_run(folders, protocol)) is not None}
    if not runs:
        raise DatasetError(f'no results in {", ".join(map(str, folders))}; '
                           'give output folders of `lmsco evaluate`')
    scenes = split.scenes if split else {}
    main = next(iter(runs.values()))
    parts = [_INTRODUCTION, *([split.about] if split and _tells_of(split, main) else [])]
    for title, groups, challenge in _scenes(main, scenes):
        found = {name: run.only(groups, challenge) for name, run in runs.items()}
        parts += _scene(title, {name: run for name, run in found.items() if run.sequences},
                        published)
    parts += ['## Conditions\n', _conditions(runs)]
    return '\n'.join(parts)


def _tells_of(split: Split, run: EvaluationRun) -> bool:
    """Return whether what a split says of its dataset holds for all sequences of a run."""
    known = frozenset().union(*split.parts.values())
    return bool(split.about) and all(
        whole.full_name.partition('+')[0] in known for whole in run.wholes)


def _scenes(run: EvaluationRun, scenes: Mapping[str, tuple[str, ...]],
            ) -> list[tuple[str, tuple[str, ...] | None, str | None]]:
    """
    Return what has a chapter of its own: title, groups and challenge, None for any.

    These are the challenges, or else the kinds of scene that the run has sequences of, and
    all sequences together.
    """
    if run.challenges:
        return [(f'{name}: {CHALLENGES[name].description}', None, name)
                for name in run.challenges]
    present = {sequence.group for sequence in run.sequences}
    found: list[tuple[str, tuple[str, ...] | None, str | None]] = [
        (f'{scene.capitalize()} ({", ".join(groups)})', groups, None)
        for scene, groups in scenes.items() if present & set(groups)]
    return found + [('All sequences', None, None)] if len(found) != 1 else found


def _scene(title: str, runs: Mapping[str, EvaluationRun],
           published: Sequence[PublishedFile]) -> list[str]:
    main = next(iter(runs.values()))
    count = f'{extent(main)}. {spread_warning(len(main.wholes))}'.strip()
    parts = [f'## {title}\n', f'{count}\n']
    if 'ope' in runs:
        parts += _one_pass(runs['ope'], published)
    if 'vot' in runs:
        supervised = summarize_supervised(runs['vot'])
        failures = {item.tracker: item.failures for item in supervised}
        low, high = eao_interval(runs['vot'])
        parts += ['### VOT supervised\n', _SUPERVISED_NOTE.format(low=low, high=high),
                  _markdown(supervised_table(supervised)),
                  _comparison(difference_rows(differences(failures, False), 2),
                              'failures per sequence (fewer is better)')]
    if 'anchors' in runs:
        starts = summarize_anchors(runs['anchors'])
        low, high = anchor_interval(runs['anchors'])
        parts += ['### Several starts\n', _ANCHORS_NOTE.format(low=low, high=high),
                  _markdown(anchor_table(starts)), _markdown(border_table(starts))]
    return parts


def _one_pass(run: EvaluationRun, published: Sequence[PublishedFile]) -> list[str]:
    others = summarize_published(run, published)
    summaries = (*summarize_one_pass(run), *others)
    aucs = {item.tracker: item.aucs for item in summaries}
    note = published_note(published, others)
    return ['### One pass\n', _ONE_PASS_NOTE, _markdown(one_pass_table(summaries)),
            *([f'{note}\n'] if note else []),
            _comparison(difference_rows(differences(aucs, True), 3), 'success AUC'),
            _BENCHMARK_NOTE, _markdown(benchmark_table(summarize_benchmarks(run))),
            _ATTRIBUTE_NOTE, f'{attribute_source(run)}\n',
            _markdown(attribute_table(summarize_attributes(run))),
            *_confidence(run)]


def _confidence(run: EvaluationRun) -> list[str]:
    summaries = summarize_confidence(run)
    absence, starts = absence_table(summaries), start_table(summarize_starts(run))
    note = size_note(run)
    parts = ['### Confidence\n', _CONFIDENCE_NOTE, *([f'{note}\n'] if note else []),
             _markdown(score_table(summarize_scores(run))),
             _markdown(confidence_table(summaries))]
    parts += [_ABSENCE_NOTE, _markdown(absence)] if absence is not None else []
    parts += [_START_NOTE, _markdown(starts)] if starts is not None else []
    return parts + _consistency(run)


def _consistency(run: EvaluationRun) -> list[str]:
    summaries = summarize_consistency(run)
    table = consistency_table(summaries)
    if table is None:
        return []
    low, high = summaries[0].band
    return ['### Covariance\n', _CONSISTENCY_NOTE.format(low=low, high=high), _markdown(table)]


def _comparison(rows: Sequence[DifferenceRow], figure: str) -> str:
    if not rows:
        return ''
    head = (f'Paired difference to {rows[0].reference}, bold where the interval leaves out '
            f'zero:\n\n| tracker | {figure} | sequences better | worse |\n|---|---|---|---|\n')
    return head + ''.join(f'| {row.tracker} | {_text(row.cell)} | {row.better} | {row.worse} |\n'
                          for row in rows)


def _markdown(table: Table) -> str:
    lines = ['| ' + ' | '.join(['tracker', *table.columns]) + ' |',
             '|' + '---|' * (len(table.columns) + 1)]
    lines += ['| ' + ' | '.join([row.tracker, *map(_text, row.cells)]) + ' |'
              for row in table.rows]
    return '\n'.join(lines) + '\n'


def _text(cell: Cell) -> str:
    text = f'**{cell.text}**' if cell.best else cell.text
    return f'{text} ({cell.range})' if cell.range else text


def _conditions(runs: Mapping[str, EvaluationRun]) -> str:
    lines = [f'- {key}: `{value}`' if key == 'command' else f'- {key}: {value}'
             for key, value in conditions(runs)]
    lines += [f'- {problem}' for problem in problems(runs)]
    return '\n'.join(lines) + '\n'
