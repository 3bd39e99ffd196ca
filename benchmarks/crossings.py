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
How often two targets that cross change their numbers: one tracker for both, and one for each.

Two persons who look the same cross in rendered scenes, and with `--dataset` a copy of the target
crosses it in recordings (the challenge `twin_crosses`, around the moment at which both are in the
same place). Both are started before they meet. A target is on the one that its box overlaps most,
or lost; going from one onto the other is a switch, but for frames in which they cover each other.
Printed is a table; with `--page` it takes the place of what stands between `<!-- crossings -->`
and `<!-- /crossings -->` there. With the package on the path:
python -m benchmarks.crossings [--scenes N] [--dataset FOLDER] [--split FILE] [--page FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.challenge_table import insert
from benchmarks.measurement import markdown_table, named_config, positive
from benchmarks.scenes import paint
from lmsco_ros.core import (
    BoundingBox, LMSCOTracker, MultiTracker, TrackerConfig, TrackResult, TrackState)
from lmsco_ros.evaluation.challenges import apply_challenge
from lmsco_ros.evaluation.challenges.presence import crossing_offsets
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.session import Request, select_sequences
from lmsco_ros.synthetic.figures import bounds, walker
from lmsco_ros.synthetic.landscape import HORIZON, render_landscape
from lmsco_ros.synthetic.sensor import Sensor

COLUMNS = ('crossing', 'pairs', 'tracker', 'switches', 'targets at the end: on their own',
           'on the other one', 'lost')
_SIZE, _FRAMES, _HEAT = (320, 256), 70, 7880.0
# Frames before and after the meeting in a recording, and how far, in sizes, they are apart then.
_MOST_AWAY, _LEAST_APART = 45, 1.5
# Below this overlap a box is on nothing.
_SEEN = 0.2


@dataclass(frozen=True, eq=False)
class Crossing:
    """
    Two targets that meet.

    Attributes
    ----------
    kind : str
        For the table.
    frames : list of ndarray
        Images; both are seen in the first.
    truth : ndarray, shape (n, 2, 4)
        Boxes of both in each frame, NaN where one is absent.

    """

    kind: str
    frames: list[npt.NDArray]
    truth: npt.NDArray[np.float64]

    @property
    def starts(self) -> list[BoundingBox]:
        """Both in the first frame."""
        return [BoundingBox(*map(float, box)) for box in self.truth[0]]


def rendered_crossing(seed: int) -> Crossing:
    """
    Return two persons of one size and heat who walk past each other, one partly before the other.

    Parameters
    ----------
    seed : int
        Decides speeds, how far the ways are apart, landscape and noise.

    """
    rng = np.random.default_rng(seed)
    width, height = _SIZE
    ground = render_landscape(width, height, 20, rng)
    sensor = Sensor((height, width), 5.0, 4.0, rng)
    tall, gap = rng.uniform(40, 75), rng.uniform(-0.15, 0.15)
    speeds = rng.uniform(0.8, 2.4, 2) * (1, -1)
    foot, paces = (HORIZON + 0.35) * height + gap * tall * np.array([-1, 1]), rng.uniform(0, 6, 2)
    order = np.argsort(foot)
    frames, truth = [], []
    for number in range(_FRAMES):
        places = width / 2 + speeds * (number - _FRAMES / 2)
        bodies = [walker((float(places[which]), float(foot[which])), tall,
                         0.06 * np.pi * number + paces[which], _HEAT) for which in (0, 1)]
        scene = ground.copy()
        # Who is nearer stands lower, and hides the other one.
        for which in order:
            paint(scene, bodies[which])
        frames.append(sensor.expose(scene, number / 30))
        truth.append([bounds(body).as_tuple() for body in bodies])
    return Crossing('two persons, rendered', frames, np.array(truth))


def recorded_crossing(sequence: TrackingSequence) -> Crossing | None:
    """Return the meeting of a target with its copy; None where there is no room for both."""
    truth, offsets = sequence.ground_truth, crossing_offsets(sequence)
    both = np.stack([truth, truth + np.pad(offsets, ((0, 0), (0, 2)))], axis=1)
    height, width = sequence.frames[0].shape[:2]
    inside = np.all((both[..., :2] >= 0) & (both[..., :2] + both[..., 2:] <= (width, height)),
                    axis=(1, 2))
    meeting = len(sequence) // 2
    far = [away for away in range(1, min(_MOST_AWAY, meeting - 1) + 1)
           if bool(inside[meeting - away]) and not is_absent(truth[meeting - away:meeting]).any()]
    if not far:
        return None
    start, end = meeting - far[-1], min(meeting + far[-1], len(sequence))
    size = np.sqrt(np.prod(truth[start, 2:]))
    if np.linalg.norm(offsets[start]) < _LEAST_APART * size:
        return None
    made = apply_challenge(sequence, 'twin_crosses')
    return Crossing('a recorded target and its copy',
                    [made.frames[index] for index in range(start, end)], both[start:end])


Boxes = list[BoundingBox | None]


def together(config: TrackerConfig, crossing: Crossing) -> Iterator[Boxes]:
    """Yield the boxes of both in each frame but the first, followed by one tracker."""
    tracker = MultiTracker(config)
    for box in crossing.starts:
        tracker.initialize(crossing.frames[0], box)
    for image in crossing.frames[1:]:
        yield [_seen(result) for result in tracker.update(image).values()]


def apart(config: TrackerConfig, crossing: Crossing) -> Iterator[Boxes]:
    """Yield the same, followed by a tracker for each."""
    trackers = [LMSCOTracker(config), LMSCOTracker(config)]
    for tracker, box in zip(trackers, crossing.starts, strict=True):
        tracker.initialize(crossing.frames[0], box)
    for image in crossing.frames[1:]:
        yield [_seen(tracker.update(image)) for tracker in trackers]


FOLLOW: Mapping[str, Callable[[TrackerConfig, Crossing], Iterator[Boxes]]] = {
    'one for both': together, 'one for each': apart}


@dataclass
class Tally:
    """What became of the targets of some crossings."""

    pairs: int = 0
    switches: int = 0
    own: int = 0
    other: int = 0
    lost: int = 0

    def add(self, boxes: Iterable[Boxes], truth: npt.NDArray[np.float64]) -> None:
        """
        Add what became of a pair.

        Parameters
        ----------
        boxes : iterable of list of BoundingBox
            Of both targets in each frame, None where one is lost.
        truth : ndarray, shape (n, 2, 4)
            True boxes in these frames.

        """
        places = np.array([[_place(box, true) for box in both]
                           for both, true in zip(boxes, truth, strict=True)])
        self.pairs += 1
        for number in (0, 1):
            known = places[places[:, number] >= 0, number]
            self.switches += int((np.diff(known) != 0).sum())
            last = places[-1, number]
            self.own += int(last == number)
            self.other += int(last == 1 - number)
            self.lost += int(last < 0)


def _seen(result: TrackResult) -> BoundingBox | None:
    """Return where a target is seen."""
    return None if result.state is TrackState.LOST else result.box


def _place(box: BoundingBox | None, truth: npt.NDArray[np.float64]) -> int:
    """Return which of the targets a box is on; -1 for none, or while they cover each other."""
    if box is None or is_absent(truth).any():
        return -1
    both = [BoundingBox(*map(float, true)) for true in truth]
    overlaps = [box.overlap(true) for true in both]
    told = max(overlaps) > _SEEN and not both[0].intersection(both[1])
    return int(np.argmax(overlaps)) if told else -1


def count(config: TrackerConfig, crossings: Iterable[Crossing]) -> dict[tuple[str, str], Tally]:
    """Return what became of all targets, by the kind of crossing and the way to follow them."""
    tallies: dict[tuple[str, str], Tally] = {}
    for crossing in crossings:
        for name, follow in FOLLOW.items():
            tally = tallies.setdefault((crossing.kind, name), Tally())
            tally.add(follow(config, crossing), crossing.truth[1:])
    return tallies


def crossing_table(tallies: Mapping[tuple[str, str], Tally]) -> str:
    """Return the table as Markdown."""
    return markdown_table(COLUMNS, [
        (kind, tally.pairs, name, tally.switches, tally.own, tally.other, tally.lost)
        for (kind, name), tally in tallies.items()])


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow, and print the table or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--config', default='default', help='preset or YAML file')
    parser.add_argument('--scenes', type=positive, default=40, help='rendered ones')
    parser.add_argument('--dataset', type=Path, help='recordings')
    parser.add_argument('--split', type=Path, help='of the dataset; its test part is taken')
    parser.add_argument('--page', type=Path)
    options = parser.parse_args(arguments)
    crossings: Iterator[Crossing] = map(rendered_crossing, range(options.scenes))
    if options.dataset:
        crossings = chain(crossings, _recorded(Request(options.dataset, split=options.split)))
    table = crossing_table(count(named_config(options.config), crossings))
    if options.page is None:
        print(table)
    else:
        page = insert(options.page.read_text(encoding='utf-8'), 'crossings', table)
        options.page.write_text(page, encoding='utf-8')


def _recorded(request: Request) -> Iterator[Crossing]:
    """Yield the crossings that there is room for."""
    for sequence in select_sequences(request).sequences:
        crossing = recorded_crossing(sequence)
        if crossing is not None:
            yield crossing


if __name__ == '__main__':
    main()
