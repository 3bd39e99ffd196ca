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

"""Options that several commands share."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, NamedTuple

import typer


class Box(NamedTuple):
    """Start box as given: x, y, width, height in pixels."""

    x: float
    y: float
    width: float
    height: float


def parse_box(text: str) -> Box:
    """Return the box of `x,y,w,h`, or tell what a box looks like."""
    try:
        numbers = [float(part) for part in text.split(',')]
    except ValueError:
        numbers = []
    if len(numbers) != 4 or not all(math.isfinite(number) for number in numbers):
        raise typer.BadParameter(f'{text!r} is no box; give four numbers x,y,w,h in pixels, '
                                 'such as 120,80,32,48')
    if numbers[2] <= 0 or numbers[3] <= 0:
        raise typer.BadParameter(f'{text!r} encloses nothing; '
                                 'width and height must be positive')
    return Box(*numbers)


# At a thousand a second, these take eleven days.
MOST_FRAMES = 10 ** 9

SourceArgument = Annotated[Path, typer.Argument(
    exists=True, show_default=False,
    help='Folder of images, TIFF stack, video file, or bag (rosbag2 or ROS 1).')]
BagArgument = Annotated[Path, typer.Argument(
    exists=True, show_default=False, help='rosbag2 (sqlite3 or mcap).')]
InitOption = Annotated[list[Box], typer.Option(
    '--init', parser=parse_box, metavar='x,y,w,h', show_default=False,
    help='Target in the first frame: top-left corner, width and height in pixels; once for each '
         'target.')]
TopicOption = Annotated[str, typer.Option(
    '--topic', show_default=False,
    help='Image topic of the bag; needed only when it has several.')]
PresetOption = Annotated[str, typer.Option('--preset', help='Named tracker configuration.')]
ConfigOption = Annotated[Path | None, typer.Option(
    '--config', exists=True, dir_okay=False, show_default=False,
    help='YAML file with a tracker configuration, in place of the preset.')]
FramesOption = Annotated[int | None, typer.Option(
    '--frames', min=1, max=MOST_FRAMES, show_default=False, help='Only the first N frames.')]
ImageTopicOption = Annotated[str, typer.Option(
    '--image-topic', help='Images of the camera, those that the tracker gets.')]
CompressedOption = Annotated[bool, typer.Option(
    '--compressed', help='Take the compressed images, on /compressed below their topic.')]
TrackerOption = Annotated[str, typer.Option('--tracker', help='Name of the tracker node.')]
NamespaceOption = Annotated[str, typer.Option(
    '--namespace', help='Namespace, that of the tracker.')]
