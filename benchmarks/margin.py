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
What losses and margins do to the tracking: starts off by chance, against ridge regression.

    python -m benchmarks.margin DATASET [--split FILE --part test] [--only PATTERN ...]
        [--challenge twin_crosses] [--frames 150] [--starts 5] [--each]

The bare filter follows: handcrafted channels, no measured size, every frame learned, by the same
30 x 2 steps in the first frame and 3 x 2 every five frames. Desired scores that the package does
not have are put in the place of its own. The first table is that of benchmarks.jittered_starts.
The second is of the margin over time: by which part of itself the peak is ahead of the highest
score half of the target's side away or more, as the median over each fifth of the sequences,
whether the peak is at the target or not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np
import numpy.typing as npt

from benchmarks.jittered_starts import (
    chosen_sequences, DecodedFrames, Outcome, report, run, sequence_options)
from benchmarks.measurement import markdown_table, positive
from lmsco_ros.core import BoundingBox, TrackerConfig, TrackResult
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.core.learning import structured_operator
from lmsco_ros.core.learning.margin import gaussian_label
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.trackers.configured import ConfiguredTracker
from lmsco_ros.evaluation.trackers.interface import Answer

FILTER = {
    'preset': 'a',
    'features': [{'channels': [{'kind': 'hog'}, {'kind': 'intensity', 'weight': 4.0}],
                  'projection': 32}],
    'sampling': {'search_factor': 4.0, 'patch_size_min': 80, 'patch_size_max': 80},
}
CONVERGED = {'iterations': 10, 'update_interval': 2}
_FIFTHS = 5
# Of the score far away, for each side of the target that a shift is away.
_FALL = 0.25

Label = Callable[[int, tuple[float, float]], npt.NDArray[np.float64]]


def shifts(size: int) -> npt.NDArray[np.float64]:
    """Return the shifts of a grid along an axis, in periods of [-1/2, 1/2)."""
    return (np.arange(size) / size + 0.5) % 1 - 0.5


def overlap_label(size: int, sigma: tuple[float, float]) -> npt.NDArray[np.float64]:
    """
    Return the overlap of the target with itself at each shift: the loss is 1 - overlap.

    Parameters
    ----------
    size : int
        Points per axis.
    sigma : tuple of float
        Standard deviations (y, x) in periods that a Gaussian label would have.

    Returns
    -------
    ndarray, shape (size, size)
        Intersection over union of the target and the target shifted, 1 at [0, 0].

    """
    rows, columns = (np.maximum(0, 1 - np.abs(shifts(size)) / _side(s)) for s in sigma)
    common = rows[:, None] * columns[None, :]
    return common / (2 - common)


def falling_label(size: int, sigma: tuple[float, float]) -> npt.NDArray[np.float64]:
    """Return a Gaussian label that falls on, below zero: the loss grows with the distance."""
    rows, columns = (shifts(size) / _side(s) for s in sigma)
    distance = np.hypot(rows[:, None], columns[None, :])
    return gaussian_label(size, sigma) - _FALL * distance


def _side(sigma: float) -> float:
    """Return the side of the target whose label has the deviation of the preset."""
    return sigma / TrackerConfig.preset('a').learning.label_sigma


@dataclass(frozen=True)
class Contender:
    """A loss, a desired score, and how they are trained."""

    learning: Mapping[str, object]
    label: Label = gaussian_label

    @property
    def config(self) -> TrackerConfig:
        """Configuration of the tracker."""
        return TrackerConfig.from_dict({**FILTER, 'learning': dict(self.learning)})


CONTENDERS = {
    'ridge': Contender({'loss': 'ridge'}),
    'ridge, C = 10': Contender({'loss': 'ridge', 'margin_weight': 10}),
    'ridge, C = 0.1': Contender({'loss': 'ridge', 'margin_weight': 0.1}),
    'ridge, 10 x 2 steps every 2 frames': Contender({'loss': 'ridge', **CONVERGED}),
    'unit anchor': Contender({'loss': 'unit'}),
    'unit anchor, C = 10': Contender({'loss': 'unit', 'margin_weight': 10}),
    'unit anchor, C = 0.1': Contender({'loss': 'unit', 'margin_weight': 0.1}),
    'unit anchor, 10 x 2 steps every 2 frames': Contender({'loss': 'unit', **CONVERGED}),
    'unit anchor, 1 - overlap': Contender({'loss': 'unit'}, overlap_label),
    'unit anchor, growing loss': Contender({'loss': 'unit'}, falling_label),
    'coupled anchor': Contender({'loss': 'coupled'}),
    'coupled anchor, 10 x 2 steps every 2 frames': Contender({'loss': 'coupled', **CONVERGED}),
    'coupled anchor, 1 - overlap': Contender({'loss': 'coupled'}, overlap_label),
    'coupled anchor, growing loss': Contender({'loss': 'coupled'}, falling_label),
}


class MarginTracker(ConfiguredTracker):
    """A tracker that notes the margin of each frame; see `margin`."""

    def __init__(self, config: TrackerConfig) -> None:
        super().__init__(config)
        self.margins: list[list[float]] = []

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start on `box`, and a new list of margins."""
        super().initialize(image, box)
        self.margins.append([])

    def update(self, image: npt.NDArray) -> Answer:
        """Track into `image`."""
        result = self._tracker.update(image)
        self.margins[-1].append(margin(result))
        return Answer(result.box, result.score, result.state, result.predicted_box,
                      result.covariance)


def margin(result: TrackResult) -> float:
    """Return how far the peak of a map is ahead of what is half a target away, as a part of it."""
    scores, region = result.confidence_map, result.search_region
    row, column = np.unravel_index(np.argmax(scores), scores.shape)
    reach = [round(side / 2 * count / length) for side, count, length in zip(
        (result.box.height, result.box.width), scores.shape, (region.height, region.width),
        strict=True)]
    away = np.array(scores)
    rows, columns = (np.arange(place - half, place + half + 1) % count for place, half, count in
                     zip((row, column), reach, scores.shape, strict=True))
    away[np.ix_(rows, columns)] = -np.inf
    return float(1 - away.max() / scores[row, column])


def compare_losses(contenders: Mapping[str, Contender], sequences: Sequence[TrackingSequence],
                   starts: int) -> tuple[dict[str, list[Outcome]], dict[str, list[list[float]]]]:
    """
    Return what each contender did on each sequence, and its margins.

    Returns
    -------
    dict of str to list of Outcome
        By contender, in the order of the sequences.
    dict of str to list of list of float
        Margins of the frames of each start.

    """
    outcomes: dict[str, list[Outcome]] = {name: [] for name in contenders}
    margins: dict[str, list[list[float]]] = {name: [] for name in contenders}
    for sequence in sequences:
        sequence = replace(sequence, frames=DecodedFrames(sequence))
        for name, contender in contenders.items():
            tracker = MarginTracker(contender.config)
            with patch.object(structured_operator, 'gaussian_label', contender.label):
                outcomes[name].append(run(tracker, sequence, starts))
            margins[name] += tracker.margins
    return outcomes, margins


def margin_table(margins: Mapping[str, Sequence[Sequence[float]]]) -> str:
    """Return the median margin of each fifth of the sequences."""
    def medians(name: str) -> list[float]:
        fifths = [np.array_split(np.array(frames), _FIFTHS) for frames in margins[name]]
        return [float(np.median(np.concatenate(parts))) for parts in zip(*fifths, strict=True)]
    names = ('first', 'second', 'third', 'fourth', 'last')
    return markdown_table(('loss', *(f'{name} fifth' for name in names)),
                          [(name, *medians(name)) for name in margins])


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both tables."""
    parser = sequence_options(__doc__.strip().splitlines()[0])
    parser.add_argument('--starts', type=positive, default=3)
    parser.add_argument('--each', action='store_true', help='a table for each sequence')
    options = parser.parse_args(arguments)
    limit_threads(1)
    sequences = chosen_sequences(options)
    outcomes, margins = compare_losses(CONTENDERS, sequences, options.starts)
    print(report(outcomes, sequences, options.each), margin_table(margins), sep='\n\n')


if __name__ == '__main__':
    main()
