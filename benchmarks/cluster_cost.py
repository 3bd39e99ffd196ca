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
What a Dask cluster costs beside processes of one machine, and how many workers one client feeds.

python -m benchmarks.cluster_cost [--sequences 24] [--frames 150] [--rounds 3] [--workers 100]

Both engines run the same jobs in turns. The model on paper takes the time per task and the bytes
per task that were measured here, and says from which time of a task on so many workers are busy.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import pickle
from statistics import median
from tempfile import TemporaryDirectory
import time

import cv2

from benchmarks.measurement import markdown_table, positive
from benchmarks.scenes import moving_scene
from lmsco_ros.evaluation.cluster import local_cluster
from lmsco_ros.evaluation.datasets import scan_dataset, TrackingSequence
from lmsco_ros.evaluation.jobs import Engine, Job, LeftOut
from lmsco_ros.evaluation.trackers import resolve
from lmsco_ros.evaluation.worker_pool import LocalProcesses

__all__ = ['Costs', 'model', 'run_time', 'write_sequences']

_SIZE, _TARGET = (320, 256), 30
_TINY_FRAMES = 2
_STARTING = 20
_GIGABIT = 125e6


@dataclass(frozen=True)
class Costs:
    """
    What one task costs whoever asked for it.

    Attributes
    ----------
    seconds : float
        Time of client and scheduler.
    sent, received : float
        Bytes of its job, and of its outcome.

    """

    seconds: float
    sent: float
    received: float


def write_sequences(folder: Path, count: int, frames: int) -> tuple[TrackingSequence, ...]:
    """Write `count` sequences of a moving target as images, and return them."""
    clip = moving_scene(_SIZE, _TARGET, frames)
    for number in range(count):
        images = folder / f'clip{number:04}' / 'img'
        images.mkdir(parents=True)
        for index, image in enumerate(clip.frames):
            cv2.imwrite(str(images / f'{index:04}.png'), image)
        rows = (','.join(f'{value:.2f}' for value in box) for box in clip.truth)
        (images.parent / 'groundtruth.txt').write_text('\n'.join(rows), encoding='utf-8')
    return scan_dataset(folder).sequences


def run_time(engine: Engine, jobs: Sequence[Job]) -> float:
    """Return the seconds that an engine takes for jobs, with the start of their processes."""
    began = time.perf_counter()
    list(engine.run(jobs))
    return time.perf_counter() - began


def model(costs: Costs, workers: int) -> list[tuple[str, float]]:
    """
    Return the limits of one client with so many workers.

    A worker that is done waits until the client has taken what came of it and given it another;
    the client does one after the other. So all are busy as long as a task takes longer than the
    client takes for a task of each.
    """
    every = costs.sent + costs.received
    return [('tasks per second that one client handles', 1 / costs.seconds),
            (f'seconds that a task must take to keep {workers} workers busy',
             workers * costs.seconds),
            (f'seconds for a network of 1 Gbit/s to carry the tasks of {workers} workers',
             workers * every / _GIGABIT),
            ('workers that tasks of 10 seconds keep busy', 10 / costs.seconds)]


def _costs(folder: Path, tracker: str, jobs: Sequence[Job], tasks: int) -> Costs:
    """Measure tasks of next to no work for the time, and those of the comparison for the bytes."""
    tiny = write_sequences(folder / 'tiny', 1, _TINY_FRAMES)[0]
    with local_cluster(2) as cluster:
        some, more = ([Job(resolve(tracker), tiny, 'ope')] * count
                      for count in (_STARTING, _STARTING + tasks))
        # What starts with the first of them is in both.
        started = run_time(cluster, some)
        spent = (run_time(cluster, more) - started) / tasks
        outcome = next(iter(cluster.run(jobs[:1])))[1]
    assert not isinstance(outcome, LeftOut)
    return Costs(spent, len(pickle.dumps(jobs[0])), len(pickle.dumps(outcome)))


def _compare(jobs: Sequence[Job], rounds: int) -> tuple[float, float]:
    """Return the median seconds of two processes and of a cluster of two workers, in turns."""
    here, there = [], []
    with local_cluster(2) as cluster:
        for _ in range(rounds):
            here.append(run_time(LocalProcesses(2), jobs))
            there.append(run_time(cluster, jobs))
    return median(here), median(there)


def main(arguments: list[str] | None = None) -> None:
    """Print the comparison and the model."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--tracker', default='default')
    parser.add_argument('--sequences', type=positive, default=24)
    parser.add_argument('--frames', type=positive, default=150)
    parser.add_argument('--rounds', type=positive, default=3)
    parser.add_argument('--tasks', type=positive, default=500, help='tiny ones, for the model')
    parser.add_argument('--workers', type=positive, default=100, help='of the model')
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as name:
        sequences = write_sequences(Path(name) / 'data', options.sequences, options.frames)
        jobs = [Job(resolve(options.tracker), sequence, 'ope') for sequence in sequences]
        here, there = _compare(jobs, options.rounds)
        costs = _costs(Path(name), 'mil', jobs, options.tasks)
    print(markdown_table(
        (f'{len(jobs)} tasks of {options.frames} frames', '--jobs 2', '--engine dask --jobs 2',
         'ratio'), [('seconds', here, there, there / here)]))
    print()
    print(markdown_table(('per task', 'value'), [
        ('milliseconds of client and scheduler', 1e3 * costs.seconds),
        ('bytes sent', costs.sent), ('bytes received', costs.received)]))
    print()
    print(markdown_table((f'model of {options.workers} workers', 'value'),
                         model(costs, options.workers)))


if __name__ == '__main__':
    main()
