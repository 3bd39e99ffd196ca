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

"""`lmsco record`: images, boxes and state of a running tracker into a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lmsco_ros.cli.console import (
    fail, FAILED, message_progress, plain_errors, say, telling_what_is_kept, warn)
from lmsco_ros.cli.options import (
    CompressedOption, ImageTopicOption, NamespaceOption, TrackerOption)
from lmsco_ros.cli.ros import require_ros


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(record)


def record(
    output: Annotated[Path, typer.Option(
        show_default=False, help='Folder of the new bag (mcap); it must not exist.')],
    image_topic: ImageTopicOption = 'image_raw',
    compressed: CompressedOption = False,
    tracker: TrackerOption = 'lmsco_tracker',
    namespace: NamespaceOption = '/',
    seconds: Annotated[float | None, typer.Option(
        min=0.1, max=10 ** 7, show_default='until Ctrl-C', help='How long to record.')] = None,
) -> None:
    """Record the images of a camera with the boxes and the state that the tracker tells."""
    with plain_errors():
        require_ros()
        from lmsco_ros.node.ros_arguments import StartError
        from lmsco_ros.replay.live_recording import LivePlan, LiveRecording

        run = LiveRecording(
            LivePlan(output, image_topic, compressed, tracker, namespace, seconds), warn)
        try:
            with telling_what_is_kept(lambda: run.kept), message_progress() as progress:
                task = progress.add_task('recording', total=None)
                run.run(lambda counts: progress.update(task, completed=counts.total()))
        except StartError as error:
            fail(str(error), FAILED)
    say(run.kept)
