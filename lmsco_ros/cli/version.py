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

"""`lmsco --version`."""

from __future__ import annotations

from typing import Annotated

import typer


def _show(wanted: bool) -> None:
    if wanted:
        from lmsco_ros import __version__

        typer.echo(f'lmsco {__version__}')
        raise typer.Exit


def register(app: typer.Typer) -> None:
    """Add the options that belong to no command to `app`."""
    app.callback()(options)


def options(
    version: Annotated[bool, typer.Option(
        '--version', is_eager=True, callback=_show,
        help='Show the version and exit.')] = False,
) -> None:
    """Follow targets in thermal video."""
