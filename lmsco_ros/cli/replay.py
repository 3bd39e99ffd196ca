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

"""`lmsco replay`: a bag through the real node."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lmsco_ros.cli.configuration import node_parameters, requested_config
from lmsco_ros.cli.console import (
    frame_progress, plain_errors, say, telling_what_is_kept, warn)
from lmsco_ros.cli.options import (
    BagArgument, ConfigOption, FramesOption, InitOption, PresetOption, TopicOption)
from lmsco_ros.cli.ros import require_ros
from lmsco_ros.replay.storage import Storage


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(replay)


def replay(
    bag: BagArgument,
    init: InitOption,
    output: Annotated[Path, typer.Option(
        show_default=False, help='Folder of the new bag; it must not exist.')],
    topic: TopicOption = '',
    rate: Annotated[float, typer.Option(
        min=0.0, help='Speed relative to the recording, with pauses of a minute at most; 0: as '
                      'fast as the node takes frames without losing one.')] = 1.0,
    preset: PresetOption = 'default',
    config: ConfigOption = None,
    frames: FramesOption = None,
    storage: Annotated[Storage, typer.Option(
        help='File format of the new bag.')] = Storage.MCAP,
    images: Annotated[bool, typer.Option(
        '--images', help='Record overlay and confidence map, too.')] = False,
) -> None:
    """
    Play a bag through the node and record its answers beside the messages of the bag.

    Boxes are those of all targets with their ids on ~/boxes, and of the last one on ~/box.
    """
    with plain_errors():
        require_ros()
        requested_config(preset, config)
        from lmsco_ros.core import BoundingBox
        from lmsco_ros.replay.bag_replay import Replay, ReplayPlan

        extra: tuple[str, ...] = ('marker', 'overlay', 'confidence_map') if images \
            else ('marker',)
        plan = ReplayPlan(
            bag=bag, output=output, storage=storage,
            boxes=tuple(BoundingBox(*box) for box in init), topic=topic, rate=rate,
            frames=frames, outputs=extra, parameters=node_parameters(preset, config))
        run = Replay(plan)
        with telling_what_is_kept(lambda: run.kept), frame_progress() as progress:
            task = progress.add_task('replaying')
            exchanges = run.run(
                lambda total: progress.update(task, total=total),
                lambda: progress.advance(task))
    missing = sum(exchange.latency is None for exchange in exchanges)
    if missing and rate:
        warn(f'the node dropped {missing} of {len(exchanges)} frames because it was not done '
             'with earlier ones; use --rate 0 to track every frame')
    elif missing:
        warn(f'the node left out {missing} of {len(exchanges)} frames; its log above may say why')
    say(f'{len(exchanges) - missing} of {len(exchanges)} frames answered')
    say(f'original messages and answers are in {output}')
