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

"""
Draw one frame's way from camera to box, each step with what it looks like and where it is done.

    python -m benchmarks.frame_way [--output PNG]

A rendered scene is followed for a while; drawn is what the tracker makes of its last frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
import numpy as np

from benchmarks.feature_maps import first_block
from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig
from lmsco_ros.core.imaging.gain import AutomaticGain
from lmsco_ros.core.imaging.regions import patch_size
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.synthetic.scene import render_scene, SceneConfig

SCENE = SceneConfig(width=256, height=256, frames=240, target_height=0.2)
FRAME = 60
STEPS = (
    ('1  frame', 'counts of the camera, checked', 'imaging/frame.py'),
    ('2  working range', 'white: the last box; orange: the region that is searched',
     'imaging/gain.py, search/prediction.py, imaging/regions.py'),
    ('3  patch', 'the region, resampled', 'imaging/view.py'),
    ('4  feature channels', 'energy in each cell',
     'features/extractor.py, fourier/interpolation.py'),
    ('5  score', 'channels times filter, summed; its peak is the place',
     'learning/memory.py, fourier/localization.py'),
    ('6  box', 'judged, measured, fused, told',
     'presence/monitor.py, extent/fusion.py'),
)
TARGET, REGION = '#00c060', '#ffb000'


def outline(axes: Axes, box: BoundingBox, color: str) -> None:
    """Draw a box."""
    axes.add_patch(Rectangle((box.x - 0.5, box.y - 0.5), box.width, box.height, fill=False,
                             edgecolor=color, linewidth=1.8))


def pictures() -> Iterator[tuple[np.ndarray, list[tuple[BoundingBox, str]]]]:
    """Yield the picture of each step, with the boxes on it."""
    config = TrackerConfig.preset('default')
    tracker, gain = LMSCOTracker(config), AutomaticGain(config.intensity)
    first, *others = islice(render_scene(SCENE), FRAME)
    result = tracker.initialize(first.image, first.box)
    gain.observe(first.image)
    for frame in others:
        before, result = result, tracker.update(frame.image)
        intensity = gain.observe(frame.image)
    view = FrameView(frame.image, intensity)
    size = patch_size(result.box.size, config.sampling, config.cell)
    patch = view.patch(result.search_region, (size, size))
    height, width = frame.image.shape
    seen = view.patch(BoundingBox(0, 0, width, height), (width, height))
    yield frame.image, []
    yield seen, [(result.search_region, REGION), (before.box, 'white')]
    yield patch, []
    yield np.linalg.norm(first_block(patch, config), axis=2), []
    yield result.confidence_map, []
    yield seen, [(result.box, TARGET)]


def draw() -> Figure:
    """Return the picture of the whole way."""
    figure = Figure(figsize=(10.0, 7.4), layout='constrained')
    panels = figure.subplots(2, len(STEPS) // 2).flat
    for axes, (name, meaning, place), (image, boxes) in zip(panels, STEPS, pictures()):
        low, high = np.percentile(image, (0.5, 99.8))
        axes.imshow(image, cmap='magma', vmin=low, vmax=high)
        for box, color in boxes:
            outline(axes, box, color)
        axes.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5),
                 xticks=[], yticks=[])
        axes.set_title(name, fontsize=11, fontweight='bold', loc='left')
        axes.set_xlabel(f'{meaning}\n{place}', fontsize=7.5, loc='left')
    figure.supxlabel(
        'Every few frames the filter of step 5 is trained: learning/memory.py, '
        'learning/collaborative.py', fontsize=8.5)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--output', type=Path, default=Path('docs/images/frame_way.png'))
    options = parser.parse_args(arguments)
    draw().savefig(options.output, dpi=90)


if __name__ == '__main__':
    main()
