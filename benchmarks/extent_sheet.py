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
Pictures of boxes with their deviations, from sequences with and beside their true boxes.

    python -m benchmarks.extent_sheet DATASET SEQUENCE... --output SHEET.png

One row for each sequence: crops around the target, evenly spread over the frames that show it.
Solid is the box that is told, the band around its edges one standard deviation to either side,
dashed the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackResult
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.geometry import is_absent

COLUMNS = 6
_CONTEXT = 2.6
_TOLD, _TRUE = '#00a0ff', '#30d030'


def edge_deviations(result: TrackResult) -> npt.NDArray[np.float64]:
    """Return the standard deviations of left, top, right and bottom edge of a told box."""
    covariance = np.asarray(result.covariance)
    deviations = []
    for sign in (-1, 1):
        for axis in range(2):
            to_edge = np.zeros(4)
            to_edge[axis], to_edge[axis + 2] = 1.0, sign / 2
            deviations.append(np.sqrt(to_edge @ covariance @ to_edge))
    return np.array(deviations)


def draw(axes: Axes, image: npt.NDArray, result: TrackResult, truth: BoundingBox,
         number: int) -> None:
    """Draw one frame around its true box."""
    side = _CONTEXT * max(truth.size)
    x, y = truth.center
    low, high = np.percentile(image, (1, 99.7))
    axes.imshow(image, cmap='gray', vmin=low, vmax=high, extent=(
        0, image.shape[1], image.shape[0], 0), interpolation='nearest')
    axes.set(xlim=(x - side / 2, x + side / 2), ylim=(y + side / 2, y - side / 2), xticks=[],
             yticks=[])
    box, (left, top, right, bottom) = result.box, edge_deviations(result)
    for wider in (-1, 1):
        axes.add_patch(Rectangle(
            (box.x - wider * left, box.y - wider * top),
            box.width + wider * (left + right), box.height + wider * (top + bottom),
            fill=False, color=_TOLD, alpha=0.45, linewidth=0.7))
    axes.add_patch(Rectangle((box.x, box.y), *box.size, fill=False, color=_TOLD, linewidth=1.4))
    axes.add_patch(Rectangle((truth.x, truth.y), *truth.size, fill=False, color=_TRUE,
                             linestyle='--', linewidth=1.0))
    axes.set_title(f'{number}: {result.box.overlap(truth):.2f}, {result.state.name.lower()}',
                   fontsize=6, pad=2)


def draw_row(row: Sequence[Axes], sequence: TrackingSequence) -> None:
    """Track a sequence from its first true box on, and draw some of its frames."""
    truth = sequence.ground_truth
    shown = np.flatnonzero(~is_absent(truth))
    chosen = shown[np.linspace(1, len(shown) - 1, len(row)).round().astype(int)]
    tracker, places = LMSCOTracker(), dict(zip(chosen.tolist(), row, strict=True))
    for number in range(int(shown[0]), int(chosen[-1]) + 1):
        image = sequence.frames[number]
        if number == shown[0]:
            tracker.initialize(image, BoundingBox(*truth[number]))
            continue
        result = tracker.update(image)
        if number in places:
            gray = image if image.ndim == 2 else image.mean(axis=2)
            draw(places[number], gray, result, BoundingBox(*truth[number]), number)
    row[0].set_ylabel(sequence.name, fontsize=6)


def main() -> None:
    """Draw the sheet that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('dataset', type=Path)
    parser.add_argument('sequences', nargs='+', help='names or patterns, such as bird_0*')
    parser.add_argument('--output', type=Path, required=True)
    options = parser.parse_args()
    found = [sequence for pattern in options.sequences
             for sequence in scan_dataset(options.dataset).sequences
             if fnmatch(sequence.full_name, pattern) or fnmatch(sequence.name, pattern)]
    if not found:
        parser.error(f'{options.dataset} holds no sequence called {options.sequences}')
    figure = Figure(figsize=(1.5 * COLUMNS, 1.62 * len(found)), layout='constrained')
    for row, sequence in zip(figure.subplots(len(found), COLUMNS, squeeze=False), found,
                             strict=True):
        draw_row(row, sequence)
    figure.savefig(options.output, dpi=110)


if __name__ == '__main__':
    main()
