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

"""`lmsco demo`: the node at work on a rendered scene or a real clip, at the pace of a camera."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

from rich.progress import Progress
import typer

from lmsco_ros.cli.configuration import node_parameters, requested_config
from lmsco_ros.cli.console import (
    fail, FAILED, frame_progress, MISUSED, plain_errors, say_where, show_pairs,
    telling_what_is_kept)
from lmsco_ros.cli.options import Box, ConfigOption, parse_box, PresetOption, TopicOption
from lmsco_ros.cli.ros import require_ros

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from lmsco_ros.core import BoundingBox
    from lmsco_ros.replay.frame import RecordedFrame
    from lmsco_ros.replay.run_outputs import RunOutputs
    from lmsco_ros.replay.scene_run import TrackedFrame
    from lmsco_ros.synthetic import SceneConfig

# Of the target's area: what shows less cannot be found.
_SEEN = 0.1
# Overlap from which a box is that of the target.
_FOUND = 0.3


@dataclass(frozen=True, eq=False)
class _Clip:
    """
    What is shown to the node.

    Attributes
    ----------
    frames : list of RecordedFrame
        All of them, so that the figures are those of the node alone; the first has stamp 0.
    start : BoundingBox
        The target in the first frame.
    truth : list of BoundingBox or None
        Where the target is, None where it is hidden; empty where that is not known.

    """

    frames: list[RecordedFrame]
    start: BoundingBox
    truth: list[BoundingBox | None]


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(demo)


def demo(
    output: Annotated[Path, typer.Option(
        file_okay=False, help='Folder for boxes.csv, overlay.mp4 and summary.png.')] = Path(
            'output/demo'),
    source: Annotated[Path | None, typer.Option(
        exists=True, show_default=False,
        help='A real clip in place of the scene: folder of images, video file or bag.')] = None,
    init: Annotated[Box | None, typer.Option(
        parser=parse_box, metavar='x,y,w,h', show_default=False,
        help='Target in the first frame of the clip.')] = None,
    topic: TopicOption = '',
    preset: PresetOption = 'default',
    config: ConfigOption = None,
    frames: Annotated[int, typer.Option(
        min=2, help='Length of the scene; of a clip, the most frames.')] = 900,
    width: Annotated[int, typer.Option(min=32, help='Width of the scene.')] = 640,
    height: Annotated[int, typer.Option(min=32, help='Height of the scene.')] = 512,
    rate: Annotated[float, typer.Option(
        min=0.1, max=1000, help='Images per second of the scene.')] = 30.0,
    seed: Annotated[int, typer.Option(
        min=0, help='Decides landscape, clutter and noise.')] = 1,
) -> None:
    """Track with the node in a rendered scene, or in a real clip, as a camera would send it."""
    if (source is None) != (init is None):
        fail('a clip needs its target: give --source and --init x,y,w,h, or neither (lmsco '
             'console CLIP shows a clip to mark it)', MISUSED)
    with plain_errors():
        require_ros()
        requested_config(preset, config)
        from lmsco_ros.replay.run_outputs import RunOutputs
        from lmsco_ros.replay.sources import open_source
        from lmsco_ros.synthetic import SceneConfig

        plot = SceneConfig(width=width, height=height, frames=frames, fps=rate, seed=seed)
        images = None if source is None else open_source(source, topic=topic)
        name = f'rendered scene {seed}' if source is None else source.resolve().name
        outputs = RunOutputs(output, plot.fps if images is None else images.fps,
                             f'{name}  ·  {config.stem if config else preset}')
        with telling_what_is_kept(lambda: outputs.kept), outputs, frame_progress() as progress:
            clip = (_render(plot, progress) if images is None or init is None else
                    _read(progress.track(islice(images, frames), description='reading',
                                         total=min(frames, len(images))), init))
            tracked = _track(clip, node_parameters(preset, config), outputs, progress)
        if not tracked:
            fail('the node answered no frame', FAILED)
        _tell(clip, tracked)
        say_where(outputs)


def _render(plot: SceneConfig, progress: Progress) -> _Clip:
    from lmsco_ros.replay.frame import RecordedFrame
    from lmsco_ros.synthetic import render_story

    shots = list(progress.track(render_story(plot), total=plot.frames, description='rendering'))
    return _Clip([RecordedFrame(shot.index, shot.stamp_ns, shot.image) for shot in shots],
                 shots[0].box, [shot.box if shot.visible > _SEEN else None for shot in shots])


def _read(images: Iterable[RecordedFrame], init: Box) -> _Clip:
    from lmsco_ros.core import BoundingBox

    frames = list(images)
    if len(frames) < 2:
        fail(f'the clip has {len(frames)} frames; give one with two at least', MISUSED)
    began = frames[0].stamp_ns
    return _Clip([replace(frame, stamp_ns=frame.stamp_ns - began) for frame in frames],
                 BoundingBox(*init), [])


def _track(clip: _Clip, parameters: dict[str, str], outputs: RunOutputs,
           progress: Progress) -> list[TrackedFrame]:
    """Run the node; rows are written as it answers, pictures when it has nothing to do."""
    from lmsco_ros.replay.scene_run import SceneRun

    def write_row(item: TrackedFrame) -> None:
        outputs.add_rows(item.frame.index, item.frame.stamp_ns, {1: item.result})

    task = progress.add_task('tracking', total=len(clip.frames))
    run = SceneRun(clip.frames, clip.start, on_sent=lambda: progress.advance(task),
                   on_answer=write_row)
    try:
        run.play(parameters)
    finally:
        tracked = run.tracked()
        for item in progress.track(tracked, description='writing'):
            truth = clip.truth[item.frame.index] if clip.truth else None
            outputs.add_picture(item.frame, {1: item.result}, truth)
    return tracked


def _tell(clip: _Clip, tracked: Sequence[TrackedFrame]) -> None:
    """Print what came of it: against the truth where that is known, and the latency."""
    import numpy as np

    latency = 1e3 * np.array([item.latency for item in tracked])
    tracker = 1e3 * np.array([item.tracker_seconds for item in tracked])
    show_pairs((
        ('frames answered', f'{len(tracked)} of {len(clip.frames)}'),
        *(_against_truth(clip, tracked) if clip.truth else ()),
        ('latency, image to box', _milliseconds(latency)),
        ('of which tracker', _milliseconds(tracker)),
        ('of which node and transport', _milliseconds(latency - tracker))))


def _against_truth(clip: _Clip, tracked: Sequence[TrackedFrame]) -> list[tuple[str, str]]:
    """Return figures of the frames that show the target, and what was said while it was hidden."""
    import numpy as np

    from lmsco_ros.core import TrackState
    from lmsco_ros.evaluation.geometry import overlaps
    from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures

    nowhere = (np.nan,) * 4
    lost = np.array([item.result.state is TrackState.LOST for item in tracked])
    shown = [clip.truth[item.frame.index] for item in tracked]
    truth = np.array([nowhere if box is None else box.as_tuple() for box in shown])
    boxes = np.array([nowhere if missing else item.result.box.as_tuple()
                      for item, missing in zip(tracked, lost)])
    figures, overlap = one_pass_figures(truth, boxes), overlaps(truth, boxes)
    rows = [('mean overlap', f'{np.nanmean(overlap):.3f}'),
            ('success (area under curve)', f'{figures.success_auc:.3f}'),
            ('precision at 5 px / 20 px',
             f'{figures.precision_at(5):.3f} / {figures.precision_at(20):.3f}')]
    hidden = np.flatnonzero(np.isnan(overlap))
    if hidden.size:
        rows.append(('said lost while hidden', f'{lost[hidden].sum()} of {hidden.size} frames'))
        again = np.flatnonzero(overlap[hidden[-1] + 1:] > _FOUND)
        stamps = [item.frame.stamp_ns for item in tracked]
        rows.append(('found again after', 'not found' if not again.size else
                     f'{1e-9 * (stamps[hidden[-1] + 1 + again[0]] - stamps[hidden[-1]]):.2f} s'))
    return rows


def _milliseconds(values: npt.NDArray[np.float64]) -> str:
    import numpy as np

    middle, high = np.percentile(values, (50, 95))
    return f'p50 {middle:.1f} ms, p95 {high:.1f} ms'
