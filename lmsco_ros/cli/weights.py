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

"""`lmsco weights`: the networks that some configurations need."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lmsco_ros.cli.console import byte_progress, plain_errors, say, show_table, warn
from lmsco_ros.extras import require_extra

NameArgument = Annotated[str, typer.Argument(
    show_default=False, help='Name of the weights, see `lmsco weights list`.')]
DirectoryOption = Annotated[Path | None, typer.Option(
    '--directory', file_okay=False, show_default='$LMSCO_WEIGHTS_DIR, else a user cache',
    help='Folder of the weights.')]


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    weights = typer.Typer(
        no_args_is_help=True, help='Get and check the networks that some configurations need.')
    for name, command in (('list', list_weights), ('fetch', fetch), ('verify', verify),
                          ('import', import_file)):
        weights.command(name)(command)
    app.add_typer(weights, name='weights')


def list_weights(directory: DirectoryOption = None) -> None:
    """Show all weights that have a name, and which of them are here."""
    from lmsco_ros.core.weights.registry import WEIGHTS
    from lmsco_ros.core.weights.store import locate, weights_directory

    with plain_errors():
        rows = []
        for source in WEIGHTS:
            path = locate(source, directory)
            state = ('missing' if path is None else
                     'comes with the package' if source.bundled else path.name)
            rows.append((source.name, state, source.license, source.purpose))
        show_table(('name', 'here', 'license', 'purpose'), rows)
        say(f'folder: {weights_directory(directory)}')


def fetch(
    name: NameArgument,
    directory: DirectoryOption = None,
    force: Annotated[bool, typer.Option('--force', help='Also when they are here.')] = False,
) -> None:
    """Download weights; a download that was broken off goes on where it stopped."""
    from lmsco_ros.core.weights.acquisition import fetch_weights, verify_weights
    from lmsco_ros.core.weights.registry import find_source
    from lmsco_ros.core.weights.store import locate

    with plain_errors():
        source = find_source(name)
        path = locate(source, directory)
        if path and not force:
            say(f'{name} is here: {path}')
            return
        require_extra('weights', 'a download of weights')
        with byte_progress() as progress:
            task = progress.add_task(name, total=None)
            path = fetch_weights(name, directory, lambda done, total: progress.update(
                task, completed=done, total=total))
        say(f'{name} is here: {path}')
        _tell_origin(verify_weights(name, directory).source_sha256, source.sha256)


def verify(name: NameArgument, directory: DirectoryOption = None) -> None:
    """Read weights in full and check that they are whole and fit their network."""
    from lmsco_ros.core.weights.acquisition import verify_weights
    from lmsco_ros.core.weights.registry import find_source

    with plain_errors():
        found = verify_weights(name, directory)
        say(f'{name} is whole and fits: {found.numbers} numbers in {found.path}')
        _tell_origin(found.source_sha256, find_source(name).sha256)


def import_file(
    file: Annotated[Path, typer.Argument(
        exists=True, dir_okay=False, show_default=False,
        help='Published file: .mat (MatConvNet), .caffemodel, .pt, .pth, .npz or .safetensors.')],
    name: Annotated[str, typer.Option(
        '--as', show_default=False, help='Name of the weights that it holds.')],
    directory: DirectoryOption = None,
) -> None:
    """Convert a file that you have and put it where the tracker finds it."""
    from lmsco_ros.core.weights.acquisition import import_weights

    with plain_errors():
        say(f'{name} is here: {import_weights(file, name, directory)}')


def _tell_origin(found: str | None, published: str | None) -> None:
    """Say what is known of the file that verified weights come from."""
    if found is None:
        warn('these weights do not tell the file that they were imported from')
    elif published is None:
        warn(f'no checksum is published; the file had the SHA-256 {found}')
    else:
        say(f'from the published file with the SHA-256 {found}')
