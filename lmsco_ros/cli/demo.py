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

"""`lmsco demo`: the node at work on a rendered scene, measured against the truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

from rich.progress import Progress
import typer

from lmsco_ros.cli.configuration import node_parameters, requested_config
from lmsco_ros.cli.console import (
    fail, FAILED, frame_progress, plain_errors, say_where, show_pairs, telling_what_is_kept)
from lmsco_ros.cli.options import ConfigOption, PresetOption
from lmsco_ros.cli.ros import require_ros

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from lmsco_ros.replay.run_outputs import RunOutputs
    from lmsco_ros.replay.scene_run import TrackedFrame
    from lmsco_ros.synthetic import SceneConfig, SceneFrame


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(demo)


def demo(
    output: Annotated[Path, typer.Option(
        file_okay=False, help='Folder for boxes.csv, overlay.mp4 and summary.png.')] = Path(
            'output/demo'),
    preset: PresetOption = 'default',
    config: ConfigOption = None,
    frames: Annotated[int, typer.Option(min=2, help='Length of the scene.')] = 360,
    width: Annotated[int, typer.Option(min=32, help='Width of the images.')] = 640,
    height: Annotated[int, typer.Option(min=32, help='Height of the images.')] = 512,
    rate: Annotated[float, typer.Option(
        min=0.1, max=1000, help='Images per second.')] = 30.0,
    seed: Annotated[int, typer.Option(
        min=0, help='Decides landscape, clutter and noise.')] = 1,
) -> None:
    """Render a thermal scene, track in it with the node, and compare with the truth."""
    with plain_errors():
        require_ros()
        requested_config(preset, config)
        from lmsco_ros.replay.run_outputs import RunOutputs
        from lmsco_ros.synthetic import SceneConfig

        plot = SceneConfig(width=width, height=height, frames=frames, fps=rate, seed=seed)
        outputs = RunOutputs(
            output, plot.fps,
            f'rendered scene {plot.seed}  ·  {config.stem if config else preset}')
        with telling_what_is_kept(lambda: outputs.kept), outputs, frame_progress() as progress:
            scene = _render(plot, progress)
            tracked = _track(scene, node_parameters(preset, config), outputs, progress)
        if not tracked:
            fail('the node answered no frame', FAILED)
        _tell(tracked, frames)
        say_where(outputs)


def _render(plot: SceneConfig, progress: Progress) -> list[SceneFrame]:
    """Render everything first, so that the figures are those of the node alone."""
    from lmsco_ros.synthetic import render_scene

    return list(progress.track(render_scene(plot), total=plot.frames,
                               description='rendering'))


def _track(scene: Sequence[SceneFrame], parameters: dict[str, str], outputs: RunOutputs,
           progress: Progress) -> list[TrackedFrame]:
    """Run the node; rows are written as it answers, pictures when it has nothing to do."""
    from lmsco_ros.replay.frame import RecordedFrame
    from lmsco_ros.replay.scene_run import SceneRun

    def write_row(item: TrackedFrame) -> None:
        outputs.add_rows(item.frame.index, item.frame.stamp_ns, {1: item.result})

    task = progress.add_task('tracking', total=len(scene))
    run = SceneRun(scene, on_sent=lambda: progress.advance(task), on_answer=write_row)
    try:
        run.play(parameters)
    finally:
        tracked = run.tracked()
        for item in progress.track(tracked, description='writing'):
            frame = item.frame
            outputs.add_picture(RecordedFrame(frame.index, frame.stamp_ns, frame.image),
                                {1: item.result}, frame.box)
    return tracked


def _tell(tracked: Sequence[TrackedFrame], sent: int) -> None:
    """Print overlap, precision and latency."""
    import numpy as np

    from lmsco_ros.core import TrackState
    from lmsco_ros.evaluation.geometry import overlaps
    from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures

    truth = np.array([item.frame.box.as_tuple() for item in tracked])
    boxes = np.array([item.result.box.as_tuple() if item.result.state is not TrackState.LOST
                      else (np.nan,) * 4 for item in tracked])
    figures = one_pass_figures(truth, boxes)
    latency = 1e3 * np.array([item.latency for item in tracked])
    tracker = 1e3 * np.array([item.tracker_seconds for item in tracked])
    show_pairs((
        ('frames answered', f'{len(tracked)} of {sent}'),
        ('mean overlap', f'{overlaps(truth, boxes).mean():.3f}'),
        ('success (area under curve)', f'{figures.success_auc:.3f}'),
        ('precision at 5 px / 20 px',
         f'{figures.precision_at(5):.3f} / {figures.precision_at(20):.3f}'),
        ('latency, image to box', _milliseconds(latency)),
        ('of which tracker', _milliseconds(tracker)),
        ('of which node and transport', _milliseconds(latency - tracker))))


def _milliseconds(values: npt.NDArray[np.float64]) -> str:
    import numpy as np

    middle, high = np.percentile(values, (50, 95))
    return f'p50 {middle:.1f} ms, p95 {high:.1f} ms'
