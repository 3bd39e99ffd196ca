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
Choose the test clips of a group by what makes tracking hard, and write the split.

    python -m benchmarks.split_selection THERMAL_DEV > benchmarks/thermal_dev.yaml

Three criteria are measured from ground truth and images: motion, size change and
clutter. The clips are ranked by each; the hardest of each ranking are taken in turn
until there are enough. Clips in which several targets appear are left to training,
since their ground truth follows the first one only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from textwrap import indent

import numpy as np
import numpy.typing as npt
import typer
import yaml

from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.geometry import is_absent

TEST_GROUPS = ('anti_uav_ir', 'ptb_tir', 'vot_tir')
CHOSEN_GROUP = 'drone_ir'
CHOSEN_COUNT = 40
SCENES = {'ground-level': ['vot_tir', 'ptb_tir'], 'aerial': ['anti_uav_ir', 'drone_ir']}
_SAMPLED_IMAGES = 12
ABOUT = """\
**What this is not.** These are a few thermal sequences, not a benchmark: the published
averages of VOT-TIR, PTB-TIR and LSOTB-TIR need the full benchmarks, which cannot be
passed on and which `lmsco evaluate` reads where you have them. `drone_ir` is a
subsample of the clips of its source, and the forty in the test part were picked as hard
ones by the criteria of `benchmarks/split_selection.py`, not at random.
"""


@dataclass(frozen=True)
class Difficulty:
    """
    How hard a clip is; larger is harder in each.

    Attributes
    ----------
    motion : float
        95th percentile of the step of the target's center from frame to frame, as a
        share of the target's size (root of its area).
    size_change : float
        Ratio of the 95th to the 5th percentile of the target's size.
    clutter : float
        Median over images of the gray-level deviation in a ring around the target (one
        target size wide), divided by the difference of the mean levels of target and ring.

    """

    motion: float
    size_change: float
    clutter: float


def measure(sequence: TrackingSequence) -> Difficulty:
    """Return the three criteria of one clip."""
    boxes = sequence.ground_truth
    sizes = np.sqrt(np.prod(boxes[:, 2:], axis=1))
    centers = boxes[:, :2] + boxes[:, 2:] / 2
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1) / sizes[1:]
    low, high = np.nanpercentile(sizes, (5, 95))
    present = np.flatnonzero(~is_absent(boxes))
    sampled = present[np.linspace(0, len(present) - 1, _SAMPLED_IMAGES).astype(int)]
    clutter = [clutter_around(sequence.frames[index], boxes[index]) for index in sampled]
    return Difficulty(motion=float(np.nanpercentile(steps, 95)), size_change=float(high / low),
                      clutter=float(np.median(clutter)))


def clutter_around(image: npt.NDArray, box: npt.NDArray[np.float64]) -> float:
    """
    Return how much the surroundings of a target vary against how far it stands out.

    Parameters
    ----------
    image : ndarray, shape (H, W)
        Gray image.
    box : ndarray, shape (4,)
        x, y, width and height of the target.

    """
    margin = np.sqrt(box[2] * box[3])
    inner = _mask(image.shape, box)
    outer = _mask(image.shape, box + (-margin, -margin, 2 * margin, 2 * margin))
    ring = image[outer & ~inner].astype(float)
    contrast = abs(image[inner].mean() - ring.mean())
    return float(ring.std() / max(contrast, 1.0))


def hardest(difficulties: Mapping[str, Difficulty], count: int) -> list[str]:
    """Return `count` names, the hardest by motion, size change and clutter in turn."""
    criteria: Sequence[Callable[[Difficulty], float]] = (
        lambda item: item.motion, lambda item: item.size_change, lambda item: item.clutter)
    rankings = [sorted(difficulties, key=lambda name: -key(difficulties[name]))
                for key in criteria]
    in_turn = dict.fromkeys(chain.from_iterable(zip(*rankings)))
    return sorted(list(in_turn)[:count])


def split_content(sequences: Iterable[TrackingSequence], several: frozenset[str]) -> dict:
    """
    Return the content of the split file.

    Parameters
    ----------
    sequences : iterable of TrackingSequence
        All sequences of the dataset.
    several : frozenset of str
        Names of clips with several targets.

    """
    names: dict[str, list[str]] = {}
    difficulties = {}
    for sequence in sequences:
        names.setdefault(sequence.group, []).append(sequence.name)
        if sequence.group == CHOSEN_GROUP and sequence.name not in several:
            difficulties[sequence.name] = measure(sequence)
    test = {group: names[group] for group in TEST_GROUPS}
    test[CHOSEN_GROUP] = hardest(difficulties, CHOSEN_COUNT)
    rest = {CHOSEN_GROUP: sorted(set(names[CHOSEN_GROUP]) - set(test[CHOSEN_GROUP]))}
    return {'scenes': SCENES, 'parts': {'test': test, 'train': rest}}


def main(dataset: Path) -> None:
    """Print the split of the dataset folder."""
    summary = dataset / CHOSEN_GROUP / 'summary.csv'
    if not summary.is_file():
        raise typer.BadParameter(f'there is no {summary}; give the folder thermal_dev')
    with summary.open(encoding='utf-8') as stream:
        several = frozenset(_several_targets(csv.DictReader(stream)))
    content = split_content(scan_dataset(dataset).sequences, several)
    print('# Written by: python -m benchmarks.split_selection THERMAL_DEV\n'
          '# The criteria are documented there. Names only; do not change by hand.')
    print('about: |\n' + indent(ABOUT, '  '), end='')
    print(yaml.safe_dump(content, sort_keys=False), end='')


def _several_targets(rows: Iterable[Mapping[str, str]]) -> Iterator[str]:
    return (row['name'] for row in rows if int(row['frames_several_targets']) > 0)


def _mask(shape: tuple[int, ...], box: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    mask = np.zeros(shape[:2], dtype=bool)
    left, top = np.maximum(np.floor(box[:2]), 0).astype(int)
    right, bottom = np.maximum(np.ceil(box[:2] + box[2:]), (left + 1, top + 1)).astype(int)
    mask[min(top, shape[0] - 1):bottom, min(left, shape[1] - 1):right] = True
    return mask


if __name__ == '__main__':
    typer.run(main)
