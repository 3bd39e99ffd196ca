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

"""`lmsco make-bag`: a folder of images or a video as a bag."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
import time
from typing import Annotated, TYPE_CHECKING

import typer

from lmsco_ros.cli.console import (
    fail, frame_progress, MISUSED, plain_errors, say, telling_what_is_kept)
from lmsco_ros.cli.options import FramesOption
from lmsco_ros.replay.storage import Storage

if TYPE_CHECKING:
    from lmsco_ros.replay.bags.output import BagOutput


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(make_bag)


def make_bag(
    source: Annotated[Path, typer.Argument(
        exists=True, show_default=False, help='Folder of images, TIFF stack, or video file.')],
    output: Annotated[Path, typer.Option(
        show_default=False, help='Folder of the new bag; it must not exist.')],
    storage: Annotated[Storage, typer.Option(help='File format.')] = Storage.MCAP,
    fps: Annotated[float | None, typer.Option(
        min=0.1, max=1000, show_default="the video's own, or 30",
        help='Frames per second.')] = None,
    topic: Annotated[str, typer.Option(help='Topic of the images.')] = 'image_raw',
    frame_id: Annotated[str, typer.Option(
        help='Coordinate frame in their headers.')] = 'thermal_camera',
    frames: FramesOption = None,
) -> None:
    """Turn a folder of images or a video into a bag, to try the node on."""
    with plain_errors():
        from lmsco_ros.replay.bag_maker import write_frames
        from lmsco_ros.replay.bags.files import is_bag
        from lmsco_ros.replay.bags.output import BagOutput
        from lmsco_ros.replay.sources import open_source

        if is_bag(source):
            fail(f'{source} is a bag already', MISUSED)
        bag = BagOutput(output, storage)
        images = open_source(source, fps=fps or 0.0)
        with telling_what_is_kept(lambda: _kept(bag, output)), frame_progress() as progress:
            total = min(len(images), frames or len(images))
            count = write_frames(
                progress.track(islice(images, frames), total=total, description='writing'),
                bag, topic=topic, frame_id=frame_id, start_ns=time.time_ns())
    say(f'{count} frames on /{topic.lstrip("/")} are in {output}')


def _kept(bag: BagOutput, output: Path) -> str:
    return f'kept in {output}: a bag with {bag.count} frames' if bag.is_complete else ''
