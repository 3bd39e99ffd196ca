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

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
from typing import Any, NoReturn, TYPE_CHECKING
import warnings

from rich.console import Console, RenderableType
from rich.markup import escape
from rich.progress import (
    BarColumn, DownloadColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn,
    TimeRemainingColumn, TransferSpeedColumn)
from rich.table import Table
import typer

if TYPE_CHECKING:
    from lmsco_ros.replay.run_outputs import RunOutputs

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
    from lmsco_ros.extras import MissingExtraError
    from lmsco_ros.replay.errors import ReplayError

    try:
        with _told_warnings():
            yield
    except ConfigError as error:
        fail(str(error), MISUSED)
    except OSError as error:
        fail(_words(error), FAILED)
    except (LMSCOError, EvaluationError, MissingExtraError, ReplayError) as error:
        fail(str(error), FAILED)


@contextmanager
def misuse() -> Iterator[None]:
    """Leave as after misuse where a command asks an evaluation for what is not there."""
    from lmsco_ros.evaluation.errors import RequestError, TrackerError

    try:
        yield
    except (RequestError, TrackerError) as error:
        fail(str(error), MISUSED)


@contextmanager
def _told_warnings() -> Iterator[None]:
    """Tell what is worth knowing about images and films like everything else."""
    from lmsco_ros.media.errors import MediaWarning

    with warnings.catch_warnings():
        show_others = warnings.showwarning
        told: set[str] = set()

        def show(message: Warning | str, category: type[Warning], *place: Any,
                 **more: Any) -> None:
            if issubclass(category, MediaWarning):
                # What is opened twice has the same to say twice.
                if str(message) not in told:
                    told.add(str(message))
                    warn(str(message))
            else:
                show_others(message, category, *place, **more)

        warnings.simplefilter('default', MediaWarning)
        warnings.showwarning = show
        yield


@contextmanager
def telling_what_is_kept(describe: Callable[[], str]) -> Iterator[None]:
    """
    Say what is kept of work that is broken off, by an error or by a signal.

    Parameters
    ----------
    describe : callable
        Called when the work is over; returns what is kept and where, or nothing.

    """
    try:
        yield
    except BaseException:
        kept = describe()
        if kept:
            warn(kept)
        raise


def fail(message: str, code: int) -> NoReturn:
    """Say what went wrong and leave."""
    _print(_Terminal(stderr=True, soft_wrap=True), f'[bold red]error:[/] {escape(message)}')
    raise typer.Exit(code)


def warn(message: str) -> None:
    """Say what is worth knowing although work goes on."""
    _print(_Terminal(stderr=True, soft_wrap=True), f'[yellow]note:[/] {escape(message)}')


def say(message: str) -> None:
    """Tell a result."""
    _print(_Terminal(soft_wrap=True), escape(message))


def say_where(outputs: RunOutputs) -> None:
    """Tell where the results of a run are."""
    earlier = ', in place of those of an earlier run' if outputs.replaced else ''
    say(f'boxes.csv, overlay.mp4 and summary.png are in {outputs.folder}{earlier}')


def show_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Show rows below their heads; the last column takes as many lines as it needs."""
    table = Table(box=None, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(head, no_wrap=number < len(heads) - 1)
    for row in rows:
        table.add_row(*map(escape, row))
    _print(_Terminal(), table)


def show_pairs(pairs: Sequence[tuple[str, str]]) -> None:
    """Show names and values side by side."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for pair in pairs:
        table.add_row(*map(escape, pair))
    _print(_Terminal(soft_wrap=True), table)


def byte_progress() -> Progress:
    """Return a progress display that counts bytes, on standard error."""
    return Progress(
        TextColumn('{task.description:<12}'), BarColumn(), DownloadColumn(),
        TransferSpeedColumn(), TimeRemainingColumn(), console=_Terminal(stderr=True))


def frame_progress() -> Progress:
    """Return a progress display that counts frames, on standard error."""
    return Progress(
        TextColumn('{task.description:<12}'), BarColumn(), MofNCompleteColumn(),
        TextColumn('frames'), TimeElapsedColumn(), TimeRemainingColumn(),
        console=_Terminal(stderr=True))


def message_progress() -> Progress:
    """Return a progress display that counts messages without an end, on standard error."""
    return Progress(
        TextColumn('{task.description:<12}'), TextColumn('{task.completed:.0f} messages'),
        TimeElapsedColumn(), console=_Terminal(stderr=True))


class _Terminal(Console):
    """A console whose reader may leave while work goes on: results are in files."""

    def on_broken_pipe(self) -> None:
        """Go on unheard, also when the program ends and what is buffered is written."""
        unheard = os.open(os.devnull, os.O_WRONLY)
        os.dup2(unheard, self.file.fileno())
        os.close(unheard)


def _print(terminal: _Terminal, content: RenderableType) -> None:
    try:
        terminal.print(content, highlight=False)
    except BrokenPipeError:
        terminal.on_broken_pipe()
    except OSError as error:
        # A complaint that nobody can read, after a terminal was closed, is no further error.
        if not terminal.stderr:
            terminal.on_broken_pipe()
            raise OSError(error.errno, error.strerror, 'standard output') from error


def _words(error: OSError) -> str:
    """Return an error of the operating system without its number."""
    if error.strerror is None:
        return str(error)
    return f'{error.filename}: {error.strerror}' if error.filename else error.strerror
