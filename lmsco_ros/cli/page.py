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

"""`lmsco console`: the operator's page beside a running tracker."""

from __future__ import annotations

import threading
from typing import Annotated

import typer

from lmsco_ros.cli.console import plain_errors
from lmsco_ros.cli.ros import require_ros
from lmsco_ros.extras import require_extra


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command('console')(page)


def page(
    image_topic: Annotated[str, typer.Option(
        help='Images to show, those that the tracker gets.')] = 'image_raw',
    tracker: Annotated[str, typer.Option(help='Name of the tracker node.')] = 'lmsco_tracker',
    namespace: Annotated[str, typer.Option(
        help='Namespace, that of the tracker.')] = '/',
    host: Annotated[str, typer.Option(
        help='Where the page is offered. Any but this machine needs a token in '
             'LMSCO_CONSOLE_TOKEN.')] = '127.0.0.1',
    port: Annotated[int, typer.Option(
        min=0, max=65535, help='Port of the page; 0: any that is free.')] = 8080,
    read_only: Annotated[bool, typer.Option(
        '--read-only', help='Pages may only look.')] = False,
) -> None:
    """Offer a page that shows the camera and the tracker, until Ctrl-C."""
    with plain_errors():
        require_ros()
        require_extra('console', 'the page')
    from lmsco_ros.console.run import run

    values = {'tracker': tracker, 'host': host, 'port': port, 'read_only': str(read_only).lower()}
    arguments = ['--ros-args', '-r', f'__ns:={namespace}', '-r', f'image_raw:={image_topic}']
    for name, value in values.items():
        arguments += ['-p', f'{name}:={value}']
    code = run(arguments, threading.Event())
    if code:
        raise typer.Exit(code)
