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

"""`lmsco console`: the operator's page, beside a running tracker or over a recording."""

from __future__ import annotations

import json
import os
from pathlib import Path
import threading
from typing import Annotated

import typer

from lmsco_ros.cli.console import fail, FAILED, MISUSED, plain_errors, say, telling_what_is_kept
from lmsco_ros.cli.options import (
    CompressedOption, ImageTopicOption, NamespaceOption, TopicOption, TrackerOption)
from lmsco_ros.cli.ros import require_ros
from lmsco_ros.extras import require_extra
from lmsco_ros.replay.storage import Storage


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command('console')(page)


def page(
    recording: Annotated[Path | None, typer.Argument(
        exists=True, show_default=False,
        help='Folder of images, TIFF stack, video file, or bag to mark a target in. Without '
             'it the page shows a camera and its tracker.')] = None,
    output: Annotated[Path, typer.Option(
        dir_okay=False, help='Text file for the marks in a recording; it must not exist.')] = Path(
            'marks.txt'),
    bag: Annotated[Path | None, typer.Option(
        show_default=False,
        help='Folder of a new bag that gets the marked boxes at the end.')] = None,
    topic: TopicOption = '',
    image_topic: ImageTopicOption = 'image_raw',
    compressed: CompressedOption = False,
    tracker: TrackerOption = 'lmsco_tracker',
    namespace: NamespaceOption = '/',
    record_folder: Annotated[Path | None, typer.Option(
        file_okay=False, show_default=False,
        help='Folder for bags that are recorded from the page. Without it there is no such '
             'button.')] = None,
    host: Annotated[str, typer.Option(
        help='Where the page is offered. Any but this machine needs a token in '
             'LMSCO_CONSOLE_TOKEN.')] = '127.0.0.1',
    port: Annotated[int, typer.Option(
        min=0, max=65535, help='Port of the page; 0: any that is free.')] = 8080,
    read_only: Annotated[bool, typer.Option(
        '--read-only', help='Pages may only look.')] = False,
) -> None:
    """Offer a page that shows camera and tracker, or a recording to mark, until Ctrl-C."""
    with plain_errors():
        require_ros()
        require_extra('console', 'the page')
        if recording is not None:
            _mark(recording, output, bag, topic, host, port, read_only)
            return
    if bag is not None or topic:
        fail('--bag and --topic are for a recording; give one', MISUSED)
    _watch(namespace, image_topic, {
        'tracker': tracker, 'host': host, 'port': port, 'read_only': str(read_only).lower(),
        'image_transport': 'compressed' if compressed else 'raw',
        # As YAML reads it, whatever is in the name.
        **({'record_folder': json.dumps(str(record_folder.absolute()))} if record_folder else {})})


def _watch(namespace: str, image_topic: str, values: dict[str, object]) -> None:
    """Run the node of the console."""
    from lmsco_ros.console.run import run

    arguments = ['--ros-args', '-r', f'__ns:={namespace}', '-r', f'image_raw:={image_topic}']
    for name, value in values.items():
        arguments += ['-p', f'{name}:={value}']
    code = run(arguments, threading.Event())
    if code:
        raise typer.Exit(code)


def _mark(recording: Path, output: Path, bag: Path | None, topic: str, host: str, port: int,
          read_only: bool) -> None:
    """Offer a recording until a signal comes; write the bag then."""
    from lmsco_ros.console.annotate import annotating
    from lmsco_ros.console.settings import ConsoleSettings, TOKEN_VARIABLE
    from lmsco_ros.node.ros_arguments import StartError
    from lmsco_ros.replay.bags.output import BagOutput

    place = BagOutput(bag, Storage.MCAP) if bag is not None else None
    settings = ConsoleSettings(host=host, port=port, read_only=read_only)
    try:
        with annotating(recording, output, settings, topic=topic,
                        token=os.environ.get(TOKEN_VARIABLE, '')) as (address, marks, frames):
            say(f'the page is at {address}; Ctrl-C ends it')
            with telling_what_is_kept(
                    lambda: f'{len(marks)} marks are in {output}' if len(marks) else ''):
                try:
                    threading.Event().wait()
                finally:
                    if place is not None and len(marks):
                        marks.write_bag(place, frames.stamps)
    except StartError as error:
        fail(str(error), FAILED)
