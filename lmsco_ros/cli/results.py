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

"""`lmsco results`: the tables of evaluations as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lmsco_ros.cli.console import misuse, plain_errors, say
from lmsco_ros.cli.evaluate_options import PublishedOption, SplitOption
from lmsco_ros.extras import require_extra


def register(app: typer.Typer) -> None:
    """Add the command of this module to `app`."""
    app.command()(results)


def results(
    folders: Annotated[list[Path], typer.Argument(
        show_default=False,
        help='Output folders of `lmsco evaluate`: other trackers on the same sequences, or '
             'shares of the sequences.')],
    page: Annotated[Path, typer.Option(
        dir_okay=False, help='Markdown file to write.')] = Path('docs/results.md'),
    split: SplitOption = None,
    published: PublishedOption = None,
) -> None:
    """Write the tables of evaluations as one Markdown page."""
    with plain_errors():
        require_extra('eval', '`lmsco results`')
    from lmsco_ros.evaluation.published import read_published
    from lmsco_ros.evaluation.results_page import results_page
    from lmsco_ros.evaluation.split import load_split
    from lmsco_ros.evaluation.whole_file import write_whole

    with plain_errors():
        with misuse():
            known = load_split(split) if split else None
            peers = [read_published(*table) for table in published or []]
        write_whole(page, results_page(folders, known, peers).encode())
        say(f'results: {page}')
