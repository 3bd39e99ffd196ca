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
Write one table of all challenges from the output folders of `lmsco evaluate`.

One row for each challenge and tracker, in the order of the challenges; with `--page` it takes
the place of what stands between `<!-- challenges -->` and `<!-- /challenges -->` there (or
another name, by `--name`). With the package on the path:
python -m benchmarks.challenge_table FOLDER [FOLDER ...] [--page docs/field.md] [--name NAME]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import re

from benchmarks.measurement import markdown_table
from lmsco_ros.evaluation.challenges import CHALLENGES
from lmsco_ros.evaluation.errors import DatasetError
from lmsco_ros.evaluation.report.formatting import interval, NONE, number
from lmsco_ros.evaluation.run_file import EvaluationRun, read_run
from lmsco_ros.evaluation.summaries.confidence import (
    confidence_parts, ConfidenceSummary, summarize_confidence)
from lmsco_ros.evaluation.summaries.one_pass import OnePassSummary, summarize_one_pass

COLUMNS = ('case', 'sequences', 'tracker', 'success AUC', 'false LOST per 1000 frames',
           'LOST declared', 'median frames to LOST', 'absent frames claimed', 'found again',
           'median frames to that')


def challenge_table(folders: Sequence[Path]) -> str:
    """
    Return the table as Markdown.

    Parameters
    ----------
    folders : sequence of Path
        Outputs of one-pass evaluations, with challenges or without.

    Raises
    ------
    DatasetError
        When a folder holds no such evaluation.

    """
    parts = [part for folder in folders for part in confidence_parts(_run(folder))]
    order = ['', *CHALLENGES]
    return markdown_table(COLUMNS, [
        (_case(name), len(run.sequences), *_figures(accuracy, word))
        for name, run in sorted(parts, key=lambda part: order.index(part[0]))
        for accuracy, word in zip(summarize_one_pass(run), summarize_confidence(run))])


def insert(page: str, name: str, table: str) -> str:
    """
    Return a page with the table between the comments of a name.

    Raises
    ------
    ValueError
        When the page has no such comments.

    """
    begin, end = f'<!-- {name} -->', f'<!-- /{name} -->'
    pattern = re.compile(f'{re.escape(begin)}.*?{re.escape(end)}', re.DOTALL)
    if not pattern.search(page):
        raise ValueError(f'the page has no {begin} ... {end}')
    return pattern.sub(lambda _: f'{begin}\n{table}\n{end}', page)


def _run(folder: Path) -> EvaluationRun:
    run = read_run(folder, 'ope')
    if run is None:
        raise DatasetError(f'{folder} has no one-pass evaluation')
    return run


def _case(name: str) -> str:
    return f'`{name}`: {CHALLENGES[name].description}' if name else 'as recorded'


def _figures(accuracy: OnePassSummary, word: ConfidenceSummary) -> list[str]:
    """Return the cells of one tracker."""
    auc = accuracy.success_auc
    spread = interval(auc)
    return [accuracy.tracker, number(auc.value) + (f' ({spread})' if spread else ''),
            number(word.false_alarms.value, 2),
            f'{word.declared} of {word.departures}' if word.departures else NONE,
            number(word.delay, 0), number(word.claimed_share.value),
            f'{word.found} of {word.returns}' if word.returns else NONE,
            number(word.found_delay, 0)]


def main() -> None:
    """Print the table, or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('folders', nargs='+', type=Path)
    parser.add_argument('--page', type=Path)
    parser.add_argument('--name', default='challenges')
    options = parser.parse_args()
    table = challenge_table(options.folders)
    if options.page is None:
        print(table)
        return
    page = insert(options.page.read_text(encoding='utf-8'), options.name, table)
    options.page.write_text(page, encoding='utf-8')


if __name__ == '__main__':
    main()
