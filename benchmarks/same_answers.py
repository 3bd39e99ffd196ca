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
Whether two checkouts of the repository answer the same, bit for bit.

Both track through sequences of a data set, as they are and under challenges, each in a process of
its own. Boxes and states have to be the same; of the scores the largest difference is told. In the
folder of the repository:
git worktree add --detach output/before COMMIT
python -m benchmarks.same_answers DATA --before output/before [--preset NAME] [--split FILE]
    [--part test] [--challenge NAME ...] [--challenged PATTERN] [--frames N]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
import os
from pathlib import Path
import subprocess
import sys
import tempfile
from typing import NamedTuple

import numpy as np

from benchmarks.measurement import markdown_table, positive
from lmsco_ros.evaluation.challenges.registry import apply_challenge
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.split import load_split

_PROCESS = Path(__file__).with_name('answers_process.py')
_SINGLE_THREAD = {'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}


class Comparison(NamedTuple):
    """What two checkouts said of one sequence."""

    sequence: str
    frames: int
    boxes: int
    states: int
    score: float


def compare(sequence: str, before: dict[str, np.ndarray],
            after: dict[str, np.ndarray]) -> Comparison:
    """
    Return in how many frames boxes and states differ, and by how much the scores do.

    Parameters
    ----------
    sequence : str
        Its name.
    before, after : dict
        `boxes`, shape (n, 4), `states` and `scores`, shape (n,), of the two.

    """
    return Comparison(
        sequence, len(after['scores']),
        int((before['boxes'] != after['boxes']).any(axis=1).sum()),
        int((before['states'] != after['states']).sum()),
        float(np.abs(before['scores'] - after['scores']).max()))


class Checkout:
    """
    A tracker of one checkout, in its process.

    Parameters
    ----------
    folder : Path
        The checkout.
    preset : str
        Its configuration.

    """

    def __init__(self, folder: Path, preset: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(_PROCESS), preset], text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **_SINGLE_THREAD, 'PYTHONPATH': str(folder.resolve())})

    def begin(self, clip: Path, output: Path) -> None:
        """Let it track through a clip."""
        assert self._process.stdin is not None
        print(clip, output, sep='\t', file=self._process.stdin, flush=True)

    def finish(self, output: Path) -> dict[str, np.ndarray]:
        """
        Return its answers.

        Raises
        ------
        RuntimeError
            When the process has ended.

        """
        assert self._process.stdout is not None
        if not self._process.stdout.readline():
            raise RuntimeError(f'the tracker ended with status {self._process.wait()}')
        with np.load(output) as arrays:
            return dict(arrays)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def challenged(sequences: Sequence[TrackingSequence], pattern: str,
               challenges: Sequence[str]) -> Iterator[TrackingSequence]:
    """Yield the sequences, and those that match the pattern under every challenge that fits."""
    yield from sequences
    for sequence in sequences:
        for name in challenges if fnmatch(sequence.full_name, pattern) else ():
            try:
                yield apply_challenge(sequence, name)
            except SequenceError:
                continue


def run(sequences: Iterator[TrackingSequence], folders: Sequence[Path], preset: str,
        limit: int | None) -> list[Comparison]:
    """Return the comparison for each sequence, beginning where its target is."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        clip, *outputs = (Path(scratch) / name for name in ('clip.npz', '0.npz', '1.npz'))
        checkouts = [Checkout(folder, preset) for folder in folders]
        for sequence in sequences:
            first = int(np.flatnonzero(~is_absent(sequence.ground_truth))[0])
            last = len(sequence) if limit is None else min(len(sequence), first + limit)
            np.savez(clip, frames=np.stack([sequence.frames[i] for i in range(first, last)]),
                     start=sequence.ground_truth[first])
            for checkout, output in zip(checkouts, outputs, strict=True):
                checkout.begin(clip, output)
            answers = [checkout.finish(output)
                       for checkout, output in zip(checkouts, outputs, strict=True)]
            rows.append(compare(sequence.full_name, *answers))
        for checkout in checkouts:
            checkout.close()
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Print the differences; return 0 when boxes and states are the same everywhere."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('data', type=Path, help='folder of a data set')
    parser.add_argument('--before', type=Path, required=True, help='folder of a checkout')
    parser.add_argument('--after', type=Path, default=Path(__file__).parents[1])
    parser.add_argument('--preset', default='default')
    parser.add_argument('--split', type=Path, default=Path(__file__).with_name('thermal_dev.yaml'))
    parser.add_argument('--part', default='test', help='part of the split')
    parser.add_argument('--challenge', action='append', default=[], help='may be repeated')
    parser.add_argument('--challenged', default='*', help='sequences that are challenged')
    parser.add_argument('--frames', type=positive, help='of each sequence, at most')
    options = parser.parse_args(arguments)
    sequences = load_split(options.split).select(
        options.part, scan_dataset(options.data).sequences)
    rows = run(challenged(sequences, options.challenged, options.challenge),
               (options.before, options.after), options.preset, options.frames)
    different = [row for row in rows if row.boxes or row.states]
    if different:
        print(markdown_table(('sequence', 'frames', 'other box', 'other state',
                              'largest difference of scores'), different) + '\n')
    print(f'{len(rows)} sequences, {sum(row.frames for row in rows)} frames: boxes and states '
          f'differ in {len(different)} sequences, scores by at most '
          f'{max(row.score for row in rows):.4f}')
    return 1 if different else 0


if __name__ == '__main__':
    sys.exit(main())
