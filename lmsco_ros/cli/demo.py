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

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
import typer

from lmsco_ros.cli.configuration import load_config, node_parameters
from lmsco_ros.cli.console import fail, FAILED, frame_progress, plain_errors, say
from lmsco_ros.cli.options import ConfigOption, PresetOption
from lmsco_ros.cli.ros import require_ros

if TYPE_CHECKING:
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
        load_config(preset, config)
        from lmsco_ros.replay.scene_run import run_scene
        from lmsco_ros.synthetic import SceneConfig

        plot = SceneConfig(width=width, height=height, frames=frames, fps=rate, seed=seed)
        with frame_progress() as progress:
            scene = _render(plot, progress)
            task = progress.add_task('tracking', total=frames)
            tracked = run_scene(scene, node_parameters(preset, config),
                                lambda: progress.advance(task))
            if not tracked:
                fail('the node answered no frame', FAILED)
            task = progress.add_task('writing', total=len(tracked))
            for _ in _write(tracked, plot, config.stem if config else preset, output):
                progress.advance(task)
        _tell(tracked, frames)
        say(f'boxes.csv, overlay.mp4 and summary.png are in {output}')


def _render(plot: SceneConfig, progress: Progress) -> list[SceneFrame]:
    """Render everything first, so that the figures are those of the node alone."""
    from lmsco_ros.synthetic import render_scene

    return list(progress.track(render_scene(plot), total=plot.frames,
                               description='rendering'))


def _write(tracked: Sequence[TrackedFrame], plot: SceneConfig, tracker: str,
           folder: Path) -> Iterator[None]:
    """Write the outputs, frame by frame."""
    from lmsco_ros.replay.frame import Frame
    from lmsco_ros.replay.run_outputs import RunOutputs

    title = f'rendered scene {plot.seed}  ·  {tracker}'
    with RunOutputs(folder, plot.fps, title) as outputs:
        for item in tracked:
            frame = item.frame
            outputs.add(Frame(frame.index, frame.stamp_ns, frame.image), item.result, frame.box)
            yield


def _tell(tracked: Sequence[TrackedFrame], sent: int) -> None:
    """Print overlap, precision and latency."""
    from lmsco_ros.core import TrackState
    from lmsco_ros.evaluation.geometry import overlaps
    from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures

    truth = np.array([item.frame.box.as_tuple() for item in tracked])
    boxes = np.array([item.result.box.as_tuple() if item.result.state is not TrackState.LOST
                      else (np.nan,) * 4 for item in tracked])
    figures = one_pass_figures(truth, boxes)
    latency = 1e3 * np.array([item.latency for item in tracked])
    tracker = 1e3 * np.array([item.tracker_seconds for item in tracked])
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in (
            ('frames answered', f'{len(tracked)} of {sent}'),
            ('mean overlap', f'{overlaps(truth, boxes).mean():.3f}'),
            ('success (area under curve)', f'{figures.success_auc:.3f}'),
            ('precision at 5 px / 20 px',
             f'{figures.precision_at(5):.3f} / {figures.precision_at(20):.3f}'),
            ('latency, image to box', _milliseconds(latency)),
            ('of which tracker', _milliseconds(tracker)),
            ('of which node and transport', _milliseconds(latency - tracker))):
        table.add_row(name, value)
    Console(soft_wrap=True).print(table)


def _milliseconds(values: npt.NDArray[np.float64]) -> str:
    middle, high = np.percentile(values, (50, 95))
    return f'p50 {middle:.1f} ms, p95 {high:.1f} ms'
