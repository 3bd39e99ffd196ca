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
Figures that others published for each sequence, beside trackers that were run here.

A file is a table of commas: a row for each tracker, a column for each sequence, and in both the
first of the names. `docs/datasets.md` shows one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lmsco_ros.evaluation.datasets.text_file import read_lines
from lmsco_ros.evaluation.errors import DatasetError, RequestError, SequenceError
from lmsco_ros.evaluation.geometry import Array
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, mean_estimate
from lmsco_ros.evaluation.protocols.one_pass import (
    NORMALIZED_THRESHOLDS, PRECISION_THRESHOLDS, SUCCESS_THRESHOLDS)
from lmsco_ros.evaluation.run_file import EvaluationRun
from lmsco_ros.evaluation.summaries.one_pass import OnePassSummary

# What can be published, and where it stands in the summary of a tracker.
FIGURES = {'success_auc': 'success_auc', 'precision_5': 'precision_5',
           'precision_20': 'precision_20', 'normalized_precision': 'normalized_auc'}
# A column that is no sequence.
_MEAN = 'mean'
_UNKNOWN = Estimate(float('nan'), float('nan'), float('nan'))


@dataclass(frozen=True)
class PublishedFile:
    """
    One figure of many trackers.

    Attributes
    ----------
    figure : str
        One of `FIGURES`.
    source : str
        Name of the file.
    values : mapping of str to mapping of str to float
        For each tracker the figure on each sequence, in [0, 1].

    """

    figure: str
    source: str
    values: Mapping[str, Mapping[str, float]]


def read_published(figure: str, path: Path) -> PublishedFile:
    """
    Return the figures in a table.

    Parameters
    ----------
    figure : str
        One of `FIGURES`.
    path : Path
        Rows `tracker,SEQUENCE,SEQUENCE,...`; a column `mean` is passed over, an empty cell is a
        figure that is not known.

    Raises
    ------
    RequestError
        When there is no such figure or file, or it holds something else.

    """
    if figure not in FIGURES:
        raise RequestError(f'there is no figure {figure!r}; known are {", ".join(FIGURES)}')
    try:
        rows = [row for row in csv.reader(read_lines(path)) if row]
    except (OSError, SequenceError, csv.Error) as error:
        raise RequestError(f'{path} cannot be read: {error}') from error
    if not rows or rows[0][0].strip().lower() != 'tracker' or len(set(rows[0])) < len(rows[0]):
        raise RequestError(f'{path} has no header tracker,SEQUENCE,SEQUENCE,... of names that are '
                           'there once each')
    values: dict[str, dict[str, float]] = {}
    for number, row in enumerate(rows[1:], 2):
        where = f'{path}, row {number}'
        if len(row) != len(rows[0]) or row[0] in values:
            raise RequestError(f'{where}: {row[0]!r} has {len(row)} cells where the header has '
                               f'{len(rows[0])}, or is there twice')
        values[row[0]] = {name.strip(): _share(cell, where)
                          for name, cell in zip(rows[0][1:], row[1:]) if name.strip() != _MEAN}
    return PublishedFile(figure, path.name, values)


def summarize_published(run: EvaluationRun,
                        files: Sequence[PublishedFile]) -> tuple[OnePassSummary, ...]:
    """
    Return what was published of the sequences of a run, a summary for each tracker.

    Trackers of which nothing is known here are left out, and so are all under challenges.

    Raises
    ------
    DatasetError
        When the run is of the first frames of its sequences only.

    """
    if not files or run.challenges:
        return ()
    if run.context.get('frames'):
        raise DatasetError('published figures are of whole sequences, and this run is of the '
                           f'first {run.context["frames"]} frames; leave out --frames')
    made: dict[str, OnePassSummary] = {}
    for file in files:
        for tracker, values in file.values.items():
            found = _on_sequences(run, values)
            if not np.isfinite(found).any():
                continue
            item = made.get(tracker) or _nothing_known(tracker, len(run.sequences))
            changes: dict[str, Any] = {FIGURES[file.figure]: mean_estimate(found)}
            if file.figure == 'success_auc':
                changes['aucs'] = found
            made[tracker] = replace(item, **changes)
    return tuple(made.values())


def published_note(files: Sequence[PublishedFile],
                   summaries: Sequence[OnePassSummary]) -> str:
    """Return what has to be said of rows that nobody ran here; empty without any."""
    if not files:
        return ''
    sources = ', '.join(file.source for file in files)
    if not summaries:
        return f'Nothing is published in {sources} of these sequences.'
    known = min(int(np.isfinite(item.aucs).sum()) for item in summaries)
    total = len(summaries[0].aucs)
    part = '' if known == total else (f' A success AUC is published for {known} of these {total} '
                                      'sequences at least; means are over those.')
    return (f'Trackers marked (published) were not run here: their figures are those that others '
            f'published for the same sequences ({sources}).{part}')


def _share(cell: str, where: str) -> float:
    """Return the share in a cell, NaN in an empty one."""
    if not cell.strip():
        return float('nan')
    try:
        value = float(cell)
    except ValueError:
        value = float('nan')
    if not 0 <= value <= 1:
        raise RequestError(f'{where}: {cell!r} is no share from 0 to 1')
    return value


def _on_sequences(run: EvaluationRun, values: Mapping[str, float]) -> Array:
    """Return the figures in the order of the run's sequences, NaN for those without."""
    return np.array([values.get(item.full_name, values.get(item.name, float('nan')))
                     for item in run.sequences])


def _nothing_known(tracker: str, sequences: int) -> OnePassSummary:
    return OnePassSummary(
        tracker=f'{tracker} (published)', aucs=np.full(sequences, np.nan),
        success=np.full(len(SUCCESS_THRESHOLDS), np.nan),
        precision=np.full(len(PRECISION_THRESHOLDS), np.nan),
        normalized=np.full(len(NORMALIZED_THRESHOLDS), np.nan),
        success_auc=_UNKNOWN, precision_5=_UNKNOWN, precision_20=_UNKNOWN,
        normalized_auc=_UNKNOWN, cpu_rate=_UNKNOWN, wall_rate=_UNKNOWN, crashes=())
