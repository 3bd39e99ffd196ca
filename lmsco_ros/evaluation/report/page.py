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

"""The report of an output folder: one self-contained page and its plots as PNG files."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure
import numpy as np

from lmsco_ros.evaluation.challenges import CHALLENGES
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.execution import PROTOCOLS
from lmsco_ros.evaluation.protocols.bootstrap import mean_estimate
from lmsco_ros.evaluation.published import (
    published_note, PublishedFile, summarize_published)
from lmsco_ros.evaluation.record_store import file_name
from lmsco_ros.evaluation.report.conditions import conditions, extent, problems
from lmsco_ros.evaluation.report.failures import worst_failures
from lmsco_ros.evaluation.report.formatting import number, spread_warning
from lmsco_ros.evaluation.report.one_pass_plots import one_pass_plots
from lmsco_ros.evaluation.report.pictures import encode, failure_strip, thumbnail
from lmsco_ros.evaluation.report.score_plots import score_plots
from lmsco_ros.evaluation.report.style import looks, PUBLISHED_COLOR
from lmsco_ros.evaluation.report.supervised_plots import expected_overlap_plot, supervised_plots
from lmsco_ros.evaluation.report.tables import (
    absence_table, anchor_table, attribute_table, benchmark_table, border_table, Cell,
    confidence_table, consistency_table, difference_rows, one_pass_table, reliability_table, Row,
    score_table, start_table, supervised_table, Table)
from lmsco_ros.evaluation.run_file import EvaluationRun
from lmsco_ros.evaluation.summaries.anchors import anchor_interval, summarize_anchors
from lmsco_ros.evaluation.summaries.attributes import attribute_source, summarize_attributes
from lmsco_ros.evaluation.summaries.benchmarks import summarize_benchmarks
from lmsco_ros.evaluation.summaries.confidence import confidence_parts, summarize_confidence
from lmsco_ros.evaluation.summaries.consistency import consistency_parts, summarize_consistency
from lmsco_ros.evaluation.summaries.differences import differences
from lmsco_ros.evaluation.summaries.one_pass import OnePassSummary, summarize_one_pass
from lmsco_ros.evaluation.summaries.score import size_note, summarize_scores
from lmsco_ros.evaluation.summaries.starts import summarize_starts
from lmsco_ros.evaluation.summaries.supervised import eao_interval, summarize_supervised
from lmsco_ros.evaluation.whole_file import write_whole
from lmsco_ros.media.colors import TRUTH_COLOR

_TITLE = 'Thermal tracking evaluation'


@dataclass(frozen=True)
class _Heat:
    """A figure of one tracker on one sequence, with a background that shows it."""

    text: str
    note: str
    color: str


def write_report(output: Path, runs: Mapping[str, EvaluationRun],
                 sequences: Mapping[str, TrackingSequence],
                 published: Sequence[PublishedFile] = ()) -> Path:
    """
    Write `report.html`, and each plot and strip as a PNG file beside it.

    Parameters
    ----------
    output : Path
        Folder of the evaluation.
    runs : mapping of str to EvaluationRun
        The run under each protocol that has one.
    sequences : mapping of str to TrackingSequence
        Images of the sequences by full name; those missing get no pictures.
    published : sequence of PublishedFile
        Figures of others that stand beside those of the one-pass run.

    Returns
    -------
    Path
        The page.

    """
    main = _main(runs)
    caution = spread_warning(len(main.wholes))
    pictures = output / 'pictures'
    trackers = dict.fromkeys(name for run in runs.values() for name in run.trackers)
    others = summarize_published(runs['ope'], published) if 'ope' in runs else ()
    colors = {name: look.color for name, look in looks(trackers).items()}
    colors.update((item.tracker, PUBLISHED_COLOR) for item in others)
    page = _template().render(
        title=_TITLE, subtitle=_subtitle(main, trackers), colors=colors,
        truth_color=TRUTH_COLOR, problems=[caution] * bool(caution) + problems(runs),
        conditions=conditions(runs),
        ope=_one_pass(runs['ope'], pictures, others) if 'ope' in runs else None,
        published=published_note(published, others),
        vot=_supervised(runs['vot'], pictures) if 'vot' in runs else None,
        anchors=_several_starts(runs['anchors'], pictures) if 'anchors' in runs else None,
        failures=list(_failures(main, sequences, colors, pictures)),
        **_sequence_table(runs, sequences))
    path = output / 'report.html'
    write_whole(path, page.encode())
    return path


def _template() -> Any:
    source = resources.files(__package__).joinpath('template.html').read_text(encoding='utf-8')
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                              lstrip_blocks=True)
    return environment.from_string(source)


def _subtitle(run: EvaluationRun, trackers: Iterable[str]) -> str:
    names = ', '.join(trackers)
    return (f'{extent(run)} of {run.context.get("dataset", "a dataset")} · {names} · '
            f'{run.context.get("date", "")}')


def _one_pass(run: EvaluationRun, folder: Path,
              others: Sequence[OnePassSummary]) -> dict[str, Any]:
    summaries, scores = summarize_one_pass(run), summarize_scores(run)
    aucs = {item.tracker: item.aucs for item in (*summaries, *others)}
    return {
        'table': one_pass_table((*summaries, *others)),
        'benchmarks': benchmark_table(summarize_benchmarks(run)),
        'plots': _save_plots(one_pass_plots(summaries), folder),
        'differences': difference_rows(differences(aucs, higher_is_better=True), 3),
        'attributes': attribute_table(summarize_attributes(run)),
        'attribute_source': attribute_source(run),
        'challenges': _challenges(run, {item.tracker: item.aucs for item in summaries}),
        'confidence': [_confidence(part, name) for name, part in confidence_parts(run)],
        'reliability': reliability_table(scores),
        'reliability_plots': _save_plots(score_plots(scores), folder),
        'consistency': _consistency(run),
    }


def _confidence(run: EvaluationRun, challenge: str) -> dict[str, Any]:
    summaries = summarize_confidence(run)
    title = f'{challenge}: {CHALLENGES[challenge].description}' if challenge else ''
    tables = (score_table(summarize_scores(run)), confidence_table(summaries),
              absence_table(summaries), start_table(summarize_starts(run)))
    return {'title': title, 'note': size_note(run),
            'tables': [table for table in tables if table is not None]}


def _consistency(run: EvaluationRun) -> list[dict[str, Any]]:
    """Return the tables of covariances by kind of scene; none where no tracker tells any."""
    parts = [(title, summarize_consistency(part)) for title, part in consistency_parts(run)]
    return [{'title': title, 'band': ' – '.join(number(end, 2) for end in summaries[0].band),
             'table': consistency_table(summaries)} for title, summaries in parts if summaries]


def _challenges(run: EvaluationRun, aucs: Mapping[str, Any]) -> Table | None:
    """Return the mean success AUC under each challenge, with the number of sequences."""
    marks = np.array([sequence.challenge for sequence in run.sequences])
    rows = tuple(
        Row(name, tuple(Cell(number(mean_estimate(values[marks == challenge]).value),
                             str((marks == challenge).sum()))
                        for challenge in run.challenges))
        for name, values in aucs.items())
    return Table(run.challenges, rows) if run.challenges else None


def _supervised(run: EvaluationRun, folder: Path) -> dict[str, Any]:
    summaries = summarize_supervised(run)
    failures = {item.tracker: item.failures for item in summaries}
    interval = eao_interval(run)
    return {
        'table': supervised_table(summaries),
        'plots': _save_plots(supervised_plots(summaries, interval), folder),
        'differences': difference_rows(differences(failures, higher_is_better=False), 2),
        'attributes': attribute_table(summarize_attributes(run), 'failures'),
        'attribute_source': attribute_source(run),
        'interval': interval,
    }


def _several_starts(run: EvaluationRun, folder: Path) -> dict[str, Any]:
    summaries = summarize_anchors(run)
    interval = anchor_interval(run)
    plots = {'anchors_eao_curve': expected_overlap_plot(summaries, interval)}
    return {'table': anchor_table(summaries), 'border': border_table(summaries),
            'plots': _save_plots(plots, folder), 'interval': interval}


def _sequence_table(runs: Mapping[str, EvaluationRun],
                    sequences: Mapping[str, TrackingSequence]) -> dict[str, Any]:
    main = _main(runs)
    figures, figure = _FIGURES[main.protocol](main)
    failures = _failure_counts(runs.get('vot'))
    rows = []
    for index, sequence in enumerate(main.sequences):
        images = sequences.get(sequence.full_name)
        cells = [_heat(float(values[index]), failures.get((name, sequence.full_name)))
                 for name, values in zip(main.trackers, figures)]
        rows.append({
            'name': sequence.name, 'group': sequence.group, 'cells': cells,
            'size': f'{sequence.size[0]} × {sequence.size[1]}',
            'frames': len(sequence.ground_truth),
            'picture': _uri(encode(thumbnail(images), '.jpg'), 'jpeg') if images else None})
    note = f'{figure} of each tracker on each sequence'
    return {'sequence_rows': rows, 'sequence_columns': main.trackers,
            'sequence_note': note + ('; below it the failures under the VOT protocol.'
                                     if failures else '.')}


# Under each protocol: the figures of each tracker on each sequence, and what they are.
_FIGURES: Mapping[str, Callable[[EvaluationRun], tuple[list[Any], str]]] = {
    'ope': lambda run: ([item.aucs for item in summarize_one_pass(run)], 'Success AUC'),
    'vot': lambda run: ([item.accuracies for item in summarize_supervised(run)], 'Accuracy'),
    'anchors': lambda run: ([item.aucs for item in summarize_anchors(run)],
                            'Success AUC (sequence@first-last frame)'),
}


def _main(runs: Mapping[str, EvaluationRun]) -> EvaluationRun:
    """Return the run that the sequences are shown from."""
    return next(runs[protocol] for protocol in PROTOCOLS if protocol in runs)


def _failure_counts(run: EvaluationRun | None) -> dict[tuple[str, str], int]:
    if run is None:
        return {}
    return {(name, sequence.full_name): len(trace.failures)
            for name, traces in run.traces.items()
            for sequence, trace in zip(run.sequences, traces)}


def _heat(value: float, failures: int | None) -> _Heat:
    """Return a cell that goes from red at 0 over white at one half to green at 1."""
    strength = min(abs(value - 0.5) * 2, 1) if np.isfinite(value) else 0
    tint = '42, 157, 88' if value >= 0.5 else '193, 18, 31'
    note = '' if not failures else f'{failures} failure{"s" if failures > 1 else ""}'
    return _Heat(number(value), note, f'rgba({tint}, {0.45 * strength:.2f})')


def _failures(run: EvaluationRun, sequences: Mapping[str, TrackingSequence],
              colors: Mapping[str, str], folder: Path) -> Iterable[dict[str, str]]:
    for failure in worst_failures(run):
        info = run.sequences[failure.sequence]
        images = sequences.get(info.full_name)
        if images is not None:
            trace = run.traces[failure.tracker][failure.sequence]
            strip = failure_strip(images.frames, info.ground_truth, trace.boxes, failure.frames,
                                  colors[failure.tracker])
            name = file_name(f'failure_{failure.tracker}_{info.group}_{info.name}.png')
            write_whole(folder / name, encode(strip, '.png'))
            yield {'tracker': failure.tracker, 'sequence': info.full_name,
                   'overlap': number(failure.mean_overlap),
                   'picture': _uri(encode(strip, '.jpg'), 'jpeg')}


def _save_plots(figures: Mapping[str, Figure], folder: Path) -> list[dict[str, str]]:
    items = []
    for name, figure in figures.items():
        stream = BytesIO()
        figure.savefig(stream, format='png')
        write_whole(folder / f'{name}.png', stream.getvalue())
        items.append({'name': name.replace('_', ' '),
                      'source': _uri(stream.getvalue(), 'png')})
    return items


def _uri(content: bytes, kind: str) -> str:
    return f'data:image/{kind};base64,{base64.b64encode(content).decode()}'
