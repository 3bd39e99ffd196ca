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
Compare configurations over sequences and over starts that are off by chance, with intervals.

    python -m benchmarks.jittered_starts DATASET [DATASET ...]
        --trackers benchmarks/comparisons/backbones.yaml
        [--split FILE --part train] [--only PATTERN ...] [--challenge NAME] [--frames 60]
        [--starts 3] [--each]

The file names configurations, as TrackerConfig.from_dict reads them; the first is what the others
are compared with. All get the same starts: the first true box, with its center off by a normal
deviation of 5 % of its sides and its sides by 5 %; what counts are the frames after it. An
interval over sequences says how far other sequences would differ, one over starts (`--each`) how
far chance does on this sequence. Differences are paired, and real where their interval does not
hold 0. A sequence that is too short for the challenge, or without a target, is left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
import zlib

import numpy as np
import numpy.typing as npt

from benchmarks.challenge_table import insert
from benchmarks.measurement import markdown_table, positive
from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.core.config.yaml_file import read_mapping
from lmsco_ros.core.errors import ConfigError
from lmsco_ros.evaluation.challenges import apply_challenge, CHALLENGES
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.execution import run_one_pass
from lmsco_ros.evaluation.geometry import is_absent, overlaps
from lmsco_ros.evaluation.protocols.bootstrap import Estimate, mean_estimate, paired_difference
from lmsco_ros.evaluation.protocols.one_pass import one_pass_figures
from lmsco_ros.evaluation.report.formatting import interval, number, signed
from lmsco_ros.evaluation.split import load_split
from lmsco_ros.evaluation.trackers.configured import ConfiguredTracker
from lmsco_ros.evaluation.trackers.interface import EvaluatedTracker

COLUMNS = ('configuration', 'success AUC', 'difference', 'normalized precision', 'lost',
           'frames/s')
_JITTER = 0.05

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """
    What one configuration did on one sequence.

    Attributes
    ----------
    success, precision : ndarray, shape (starts,)
        AUC of the success curve and of the normalized precision curve.
    lost : ndarray, shape (starts,)
        1 where the last box of the sequence does not touch the target.
    rate : float
        Frames per second of processor time.

    """

    success: Array
    precision: Array
    lost: Array
    rate: float


class DecodedFrames:
    """
    The frames of a sequence in memory, since each is looked at many times.

    Parameters
    ----------
    sequence : TrackingSequence
        Whose frames they are.

    """

    def __init__(self, sequence: TrackingSequence) -> None:
        self.signature = sequence.frames.signature
        self._images = [sequence.frames[index] for index in range(len(sequence))]

    def __len__(self) -> int:
        return len(self._images)

    def __getitem__(self, index: int) -> npt.NDArray:
        return self._images[index]


def read_trackers(path: Path) -> dict[str, TrackerConfig]:
    """
    Return the configurations in a file, by their names.

    Raises
    ------
    ConfigError
        When the file or one of them cannot be read; names which.

    """
    found = {}
    for name, values in read_mapping(path).items():
        try:
            found[str(name)] = TrackerConfig.from_dict(values)
        except (ConfigError, TypeError, ValueError) as error:
            raise ConfigError(f'{path}: {name}: {error}') from error
    return found


def chosen_sequences(options: argparse.Namespace) -> list[TrackingSequence]:
    """Return the sequences that the command line asks for, cut and with their challenge."""
    sequences = [sequence for folder in options.datasets
                 for sequence in scan_dataset(folder).sequences]
    if options.split is not None:
        sequences = load_split(options.split).select(options.part, sequences)
    if options.only:
        sequences = [sequence for sequence in sequences
                     if any(fnmatch(sequence.full_name, pattern) for pattern in options.only)]
    changed = []
    for sequence in sequences:
        try:
            # Cut first, or what happens in the middle would happen after the end.
            sequence = sequence.first(options.frames)
            if options.challenge is not None:
                sequence = apply_challenge(sequence, options.challenge)
            changed.append(sequence)
        except SequenceError as error:
            print(f'{sequence.full_name} is left out: {error}')
    if not changed:
        raise SystemExit('no sequence is left; choose others by --only, --part or --challenge')
    return changed


def jittered(sequence: TrackingSequence, start: int) -> Array:
    """Return the first true box, off by what the number of the start decides."""
    rng = np.random.default_rng([zlib.crc32(sequence.full_name.encode()), start])
    present = int(np.flatnonzero(~is_absent(sequence.ground_truth))[0])
    x, y, width, height = sequence.ground_truth[present]
    sides = np.array([width, height])
    center = np.array([x, y]) + sides / 2 + _JITTER * sides * rng.normal(size=2)
    sides = sides * np.exp(_JITTER * rng.normal(size=2))
    box: Array = np.concatenate([center - sides / 2, sides])
    return box


def run(tracker: EvaluatedTracker, sequence: TrackingSequence, starts: int) -> Outcome:
    """Follow a sequence, whose frames are in memory, from several starts."""
    present = int(np.flatnonzero(~is_absent(sequence.ground_truth))[0])
    success, precision, lost, updates, seconds = [], [], [], 0, 0.0
    for start in range(starts):
        truth = sequence.ground_truth.copy()
        truth[present] = jittered(sequence, start)
        trace = run_one_pass(tracker, replace(sequence, ground_truth=truth))
        if trace.error is not None:
            raise SystemExit(f'{sequence.full_name}: {trace.error}')
        later, boxes = sequence.ground_truth[present + 1:], trace.boxes[present + 1:]
        figures = one_pass_figures(later, boxes)
        success.append(figures.success_auc)
        precision.append(figures.normalized_precision_auc)
        seen = overlaps(later, boxes)
        lost.append(float(seen[np.isfinite(seen)][-1] == 0))
        updates, seconds = updates + trace.updates, seconds + trace.cpu_seconds
    return Outcome(np.array(success), np.array(precision), np.array(lost), updates / seconds)


def compare(trackers: Mapping[str, TrackerConfig], sequences: Sequence[TrackingSequence],
            starts: int) -> dict[str, list[Outcome]]:
    """Return the outcomes of each configuration, one for each sequence."""
    outcomes: dict[str, list[Outcome]] = {name: [] for name in trackers}
    for sequence in sequences:
        sequence = replace(sequence, frames=DecodedFrames(sequence))
        for name, config in trackers.items():
            outcomes[name].append(run(ConfiguredTracker(config), sequence, starts))
    return outcomes


def over_sequences(outcomes: Mapping[str, Sequence[Outcome]]) -> str:
    """Return the table of all sequences; each counts by the mean of its starts."""
    def means(name: str) -> Array:
        return np.array([outcome.success.mean() for outcome in outcomes[name]])

    first = means(next(iter(outcomes)))
    return markdown_table(COLUMNS, [
        _row(name, mean_estimate(means(name)), paired_difference(means(name), first), several)
        for name, several in outcomes.items()])


def over_starts(outcomes: Mapping[str, Sequence[Outcome]], index: int) -> str:
    """Return the table of one sequence, with intervals over its starts."""
    first = next(iter(outcomes.values()))[index].success
    return markdown_table(COLUMNS, [
        _row(name, mean_estimate(several[index].success),
             paired_difference(several[index].success, first), [several[index]])
        for name, several in outcomes.items()])


def _row(name: str, auc: Estimate, difference: Estimate, several: Sequence[Outcome]) -> list[str]:
    """Return the cells of one configuration."""
    precision = np.mean([outcome.precision.mean() for outcome in several])
    lost = np.concatenate([outcome.lost for outcome in several])
    rate = len(several) / sum(1 / outcome.rate for outcome in several)
    return [name, f'{number(auc.value)} ({interval(auc)})',
            f'{signed(difference)} ({interval(difference)})', number(float(precision)),
            f'{int(lost.sum())} of {len(lost)}', f'{rate:.0f}']


def report(outcomes: Mapping[str, Sequence[Outcome]], sequences: Sequence[TrackingSequence],
           each: bool) -> str:
    """Return what was found, as Markdown."""
    if not each:
        return over_sequences(outcomes)
    return '\n\n'.join(f'`{sequence.full_name}`\n\n{over_starts(outcomes, index)}'
                       for index, sequence in enumerate(sequences))


def sequence_options(description: str) -> argparse.ArgumentParser:
    """Return a parser that knows which sequences are meant."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument('datasets', type=Path, nargs='+', metavar='DATASET')
    parser.add_argument('--split', type=Path)
    parser.add_argument('--part', default='train')
    parser.add_argument('--only', nargs='+', metavar='PATTERN')
    parser.add_argument('--challenge', choices=CHALLENGES)
    parser.add_argument('--frames', type=positive, default=60)
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables, or write them into a page."""
    parser = sequence_options(__doc__.strip().splitlines()[0])
    parser.add_argument('--trackers', type=Path, required=True)
    parser.add_argument('--starts', type=positive, default=3)
    parser.add_argument('--each', action='store_true', help='a table for each sequence')
    parser.add_argument('--page', type=Path)
    parser.add_argument('--name', default='comparison')
    options = parser.parse_args(arguments)
    limit_threads(1)
    trackers, sequences = read_trackers(options.trackers), chosen_sequences(options)
    table = report(compare(trackers, sequences, options.starts), sequences, options.each)
    if options.page is None:
        print(table)
    else:
        page = insert(options.page.read_text(encoding='utf-8'), options.name, table)
        options.page.write_text(page, encoding='utf-8')


if __name__ == '__main__':
    main()
