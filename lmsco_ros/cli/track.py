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

"""`lmsco track`: follow a target through a recording, without ROS."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
import time
from typing import Annotated, TYPE_CHECKING

import typer

from lmsco_ros.cli.configuration import requested_config
from lmsco_ros.cli.console import (
    fail, FAILED, frame_progress, MISUSED, plain_errors, say, say_where, telling_what_is_kept,
    warn)
from lmsco_ros.cli.options import (
    Box, ConfigOption, FramesOption, parse_box, PresetOption, SourceArgument, TopicOption)

if TYPE_CHECKING:
    from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackResult
    from lmsco_ros.replay.frame import RecordedFrame
    from lmsco_ros.replay.run_outputs import RunOutputs
    from lmsco_ros.replay.sources import Source


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(track)


def track(
    source: SourceArgument,
    init: Annotated[Box | None, typer.Option(
        parser=parse_box, metavar='x,y,w,h', show_default=False,
        help='Target in the first frame: top-left corner, width and height in pixels. '
             'May be left out when there is a ground truth.')] = None,
    topic: TopicOption = '',
    preset: PresetOption = 'default',
    config: ConfigOption = None,
    output: Annotated[Path | None, typer.Option(
        file_okay=False, show_default='output/<source>',
        help='Folder for boxes.csv, overlay.mp4 and summary.png.')] = None,
    frames: FramesOption = None,
    ground_truth: Annotated[Path | None, typer.Option(
        exists=True, dir_okay=False, show_default=False,
        help='One row a frame, x,y,w,h or polygon corners: shown, and compared with.')] = None,
) -> None:
    """Follow a target through a folder of images, a video or a bag."""
    if init is None and ground_truth is None:
        fail('no target; give --init x,y,w,h, or a --ground-truth that starts with it', MISUSED)
    folder = output or Path('output') / source.resolve().stem
    if folder.resolve() == source.resolve():
        fail(f'{folder} is the source; choose another --output', MISUSED)
    with plain_errors():
        from lmsco_ros.core import LMSCOTracker
        from lmsco_ros.replay.run_outputs import RunOutputs
        from lmsco_ros.replay.sources import open_source

        settings = requested_config(preset, config)
        images = open_source(source, topic=topic)
        truth = _read_truth(ground_truth, len(images))
        start = _start_box(init, truth)
        outputs = RunOutputs(
            folder, images.fps, f'{_title(source)}  ·  {config.stem if config else preset}')
        with telling_what_is_kept(lambda: outputs.kept):
            _run(LMSCOTracker(settings), images, start, truth, outputs, limit=frames)
        say_where(outputs)


def _read_truth(path: Path | None, frames: int) -> list[BoundingBox | None]:
    """Return the true boxes, None where the target is absent; empty without a file."""
    from lmsco_ros.core import BoundingBox
    from lmsco_ros.evaluation.datasets.boxes_text import read_boxes
    from lmsco_ros.evaluation.geometry import is_absent

    if path is None:
        return []
    rows = read_boxes(path, frames)
    if len(rows) != frames:
        warn(f'{path.name} has {len(rows)} rows for {frames} frames; compared is what has both')
    return [None if absent else BoundingBox(*map(float, row))
            for row, absent in zip(rows, is_absent(rows))]


def _start_box(init: Box | None, truth: list[BoundingBox | None]) -> BoundingBox:
    from lmsco_ros.core import BoundingBox

    if init is not None:
        return BoundingBox(*init)
    if truth[0] is None:
        fail('the ground truth has no target in the first frame; give --init x,y,w,h', MISUSED)
    return truth[0]


def _title(source: Path) -> str:
    """Return a name that says what the images are, even where their folder is called `ir`."""
    return '/'.join(source.resolve().parts[-2:]).lstrip('/')


def _run(tracker: LMSCOTracker, images: Source, start: BoundingBox,
         truth: list[BoundingBox | None], outputs: RunOutputs, *, limit: int | None) -> None:
    """Track, write the outputs and tell the figures."""
    expected = min(len(images), limit or len(images))
    seconds, count, overlaps = 0.0, 0, []
    with outputs, frame_progress() as progress:
        task = progress.add_task('tracking', total=expected)
        for frame, result, spent in _results(tracker, islice(images, limit), start):
            known = truth[frame.index] if frame.index < len(truth) else None
            if not count:
                _tell_start(start, frame)
            outputs.add(frame, result, known)
            seconds, count = seconds + spent, count + 1
            overlaps += [] if known is None else [_overlap(result, known)]
            progress.advance(task)
    if not count:
        fail('the source ended before its first frame', FAILED)
    say(f'{count} frames, {count / seconds:.1f} frames/s in the tracker')
    if overlaps:
        say(f'mean overlap {sum(overlaps) / len(overlaps):.3f} over {len(overlaps)} frames')


def _tell_start(start: BoundingBox, frame: RecordedFrame) -> None:
    """Say when a part of the target cannot be seen."""
    height, width = frame.image.shape[:2]
    x, y, across, down = start.as_tuple()
    if min(x, y) < 0 or x + across > width or y + down > height:
        warn(f'the start box {x:g},{y:g},{across:g},{down:g} reaches beyond the image of '
             f'{width} x {height} pixels; only the part inside is seen')


def _results(tracker: LMSCOTracker, frames: Iterator[RecordedFrame], start: BoundingBox,
             ) -> Iterator[tuple[RecordedFrame, TrackResult, float]]:
    """Yield each frame with what the tracker says and the seconds it took."""
    for frame in frames:
        began, taken = time.perf_counter(), 1e-9 * frame.stamp_ns
        result = (tracker.update(frame.image, taken) if tracker.initialized
                  else tracker.initialize(frame.image, start, taken))
        yield frame, result, time.perf_counter() - began


def _overlap(result: TrackResult, truth: BoundingBox) -> float:
    """Return the overlap with the truth; a lost target is a miss."""
    return 0.0 if result.state.name == 'LOST' else result.box.overlap(truth)
