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

"""`lmsco track`: follow targets through a recording, without ROS."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from pathlib import Path
import time
from typing import Annotated, TYPE_CHECKING

import typer

from lmsco_ros.cli.configuration import requested_config
from lmsco_ros.cli.console import (
    fail, FAILED, frame_progress, MISUSED, plain_errors, say, say_where, telling_what_is_kept,
    warn)
from lmsco_ros.cli.options import (
    Box, ConfigOption, FramesOption, MOST_FRAMES, parse_box, PresetOption, SourceArgument,
    TopicOption)
from lmsco_ros.cli.selection import require_windows, select_boxes

if TYPE_CHECKING:
    from lmsco_ros.core import BoundingBox, MultiTracker, TrackResult
    from lmsco_ros.replay.frame import RecordedFrame
    from lmsco_ros.replay.run_outputs import RunOutputs
    from lmsco_ros.replay.sources import Source


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(track)


def track(
    source: SourceArgument,
    init: Annotated[list[Box] | None, typer.Option(
        parser=parse_box, metavar='x,y,w,h', show_default=False,
        help='Target in the first frame: top-left corner, width and height in pixels; once for '
             'each target. May be left out when there is a ground truth.')] = None,
    select: Annotated[bool, typer.Option(
        '--select', help='Drag a box around each target in a window.')] = False,
    start: Annotated[int, typer.Option(
        min=0, max=MOST_FRAMES, metavar='FRAME',
        help='Number of the frame to start on; those before are left out.')] = 0,
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
    """Follow targets through a folder of images, a video or a bag."""
    if select and init:
        fail('--select and --init both name the targets; give one of them', MISUSED)
    if not select and not init and ground_truth is None:
        fail('no target; give --init x,y,w,h, --select, or a --ground-truth that starts with it',
             MISUSED)
    folder = output or Path('output') / source.resolve().stem
    if folder.resolve() == source.resolve():
        fail(f'{folder} is the source; choose another --output', MISUSED)
    with plain_errors():
        from lmsco_ros.core import MultiTracker
        from lmsco_ros.replay.run_outputs import RunOutputs
        from lmsco_ros.replay.sources import open_source

        if select:
            require_windows()
        settings = requested_config(preset, config)
        images = open_source(source, topic=topic)
        truth = _read_truth(ground_truth, len(images))
        run, boxes = _start(_part(images, start, frames), select, init or [], truth[start:])
        outputs = RunOutputs(
            folder, images.fps, f'{_title(source)}  ·  {config.stem if config else preset}')
        with telling_what_is_kept(lambda: outputs.kept):
            _run(MultiTracker(settings), run, boxes, truth, outputs,
                 expected=min(len(images) - start, frames or len(images)))
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


def _part(images: Source, start: int, frames: int | None) -> Iterator[RecordedFrame]:
    """Return so many frames of the source, from one of them on."""
    if start and start >= len(images):
        fail(f'there is no frame {start}; the source has {len(images)}, so give --start 0 to '
             f'{len(images) - 1}', MISUSED)
    return islice(images, start, None if frames is None else start + frames)


def _start(run: Iterator[RecordedFrame], select: bool, init: Sequence[Box],
           truth: list[BoundingBox | None],
           ) -> tuple[Iterable[RecordedFrame], list[BoundingBox]]:
    """Return the frames, and the boxes of the targets in the first one: dragged, given or true."""
    from lmsco_ros.core import BoundingBox

    if select:
        first = next(run, None)
        return (run, []) if first is None else (chain([first], run), select_boxes(first.image))
    if init:
        return run, [BoundingBox(*box) for box in init]
    if not truth or truth[0] is None:
        fail('the ground truth has no target in the first frame; give --init x,y,w,h', MISUSED)
    return run, [truth[0]]


def _title(source: Path) -> str:
    """Return a name that says what the images are, even where their folder is called `ir`."""
    return '/'.join(source.resolve().parts[-2:]).lstrip('/')


def _run(tracker: MultiTracker, frames: Iterable[RecordedFrame], boxes: Sequence[BoundingBox],
         truth: list[BoundingBox | None], outputs: RunOutputs, *, expected: int) -> None:
    """Track, write the outputs and tell the figures; the truth is that of the first target."""
    seconds, count, overlaps = 0.0, 0, []
    told: dict[int, str] = {}
    with outputs, frame_progress() as progress:
        task = progress.add_task('tracking', total=expected)
        for frame, results, spent in _results(tracker, frames, boxes):
            known = truth[frame.index] if frame.index < len(truth) else None
            if not count:
                _tell_start(boxes, frame)
            _tell_notes(results, told, frame.index)
            outputs.add(frame, results, known)
            seconds, count = seconds + spent, count + 1
            overlaps += [] if known is None else [_overlap(next(iter(results.values())), known)]
            progress.advance(task)
    if not count:
        fail('the source ended before its first frame', FAILED)
    say(f'{count} frames, {count / seconds:.1f} frames/s in the tracker')
    if overlaps:
        say(f'mean overlap {sum(overlaps) / len(overlaps):.3f} over {len(overlaps)} frames')


def _tell_start(boxes: Sequence[BoundingBox], frame: RecordedFrame) -> None:
    """Say when a part of a target cannot be seen."""
    height, width = frame.image.shape[:2]
    for x, y, across, down in (box.as_tuple() for box in boxes):
        if min(x, y) < 0 or x + across > width or y + down > height:
            warn(f'the start box {x:g},{y:g},{across:g},{down:g} reaches beyond the image of '
                 f'{width} x {height} pixels; only the part inside is seen')


def _tell_notes(results: Mapping[int, TrackResult], told: dict[int, str], index: int) -> None:
    """Say what the tracker says in words, unless it is what was told of the frame before."""
    for number, result in results.items():
        if result.note and result.note != told.get(number):
            warn(f'frame {index}, target {number}: {result.note}')
        told[number] = result.note


def _results(tracker: MultiTracker, frames: Iterable[RecordedFrame], boxes: Sequence[BoundingBox],
             ) -> Iterator[tuple[RecordedFrame, Mapping[int, TrackResult], float]]:
    """Yield each frame with what the tracker says and the seconds it took."""
    for frame in frames:
        began, taken = time.perf_counter(), 1e-9 * frame.stamp_ns
        if tracker.ids:
            results = tracker.update(frame.image, taken)
        else:
            for box in boxes:
                tracker.initialize(frame.image, box, taken)
            results = tracker.results
        yield frame, results, time.perf_counter() - began


def _overlap(result: TrackResult, truth: BoundingBox) -> float:
    """Return the overlap with the truth; a lost target is a miss."""
    return 0.0 if result.state.name == 'LOST' else result.box.overlap(truth)
