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

"""How commands speak: progress, plain errors, exit codes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn
import warnings

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn, DownloadColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn,
    TimeRemainingColumn, TransferSpeedColumn)
from rich.table import Table
import typer

FAILED, MISUSED = 1, 2


@contextmanager
def plain_errors() -> Iterator[None]:
    """
    Tell errors that a user can act on in one line, and leave with an exit code.

    Errors of our own all are ValueErrors with a message made for people; a configuration
    that is wrong counts as misuse.
    """
    from lmsco_ros.core.errors import ConfigError, LMSCOError
    from lmsco_ros.evaluation.errors import EvaluationError
    from lmsco_ros.replay.errors import ReplayError

    try:
        with _told_warnings():
            yield
    except ConfigError as error:
        fail(str(error), MISUSED)
    except (LMSCOError, EvaluationError, ReplayError, OSError) as error:
        fail(str(error), FAILED)


@contextmanager
def _told_warnings() -> Iterator[None]:
    """Tell what is worth knowing about images and films like everything else."""
    from lmsco_ros.media.errors import MediaWarning

    with warnings.catch_warnings():
        show_others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any,
                 **more: Any) -> None:
            if issubclass(category, MediaWarning):
                warn(str(message))
            else:
                show_others(message, category, *place, **more)

        warnings.simplefilter('default', MediaWarning)
        warnings.showwarning = show
        yield


def fail(message: str, code: int) -> NoReturn:
    """Say what went wrong and leave."""
    Console(stderr=True, soft_wrap=True).print(
        f'[bold red]error:[/] {escape(message)}', highlight=False)
    raise typer.Exit(code)


def warn(message: str) -> None:
    """Say what is worth knowing although work goes on."""
    Console(stderr=True, soft_wrap=True).print(
        f'[yellow]note:[/] {escape(message)}', highlight=False)


def say(message: str) -> None:
    """Tell a result."""
    Console(soft_wrap=True).print(escape(message), highlight=False)


def show_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Show rows below their heads; the last column takes as many lines as it needs."""
    table = Table(box=None, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(head, no_wrap=number < len(heads) - 1)
    for row in rows:
        table.add_row(*map(escape, row))
    Console().print(table)


def byte_progress() -> Progress:
    """Return a progress display that counts bytes, on standard error."""
    return Progress(
        TextColumn('{task.description:<12}'), BarColumn(), DownloadColumn(),
        TransferSpeedColumn(), TimeRemainingColumn(), console=Console(stderr=True))


def frame_progress() -> Progress:
    """Return a progress display that counts frames, on standard error."""
    return Progress(
        TextColumn('{task.description:<12}'), BarColumn(), MofNCompleteColumn(),
        TextColumn('frames'), TimeElapsedColumn(), TimeRemainingColumn(),
        console=Console(stderr=True))
