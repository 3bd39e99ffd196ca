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
Speed of trackers side by side: the same frames, one after the other, in one process.

Every frame is shown to each tracker in turn before the next one is, so that a slow moment of the
machine meets them all; reading and decoding are not part of the time. Trackers are presets, YAML
files of configurations, and whatever `lmsco evaluate` takes (`csrt`, `kcf`, ...;
`nanotrack:backbone.onnx,head.onnx`). CSRT needs OpenCV's contrib build (extra `peers`); who cannot
be built here is named and left out. In the folder of the repository:
python -m benchmarks.side_by_side --dataset FOLDER [--sequences PATTERN] [--frames N] [--limit N]
    [--tracker NAME ...] [--threads N]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from benchmarks.measurement import (
    markdown_table, named_config, positive, PROCESSOR, take_turns, WALL)
from benchmarks.scenes import Clip, recorded_clips, walking_scene
from lmsco_ros.core import LMSCOError, TrackState
from lmsco_ros.core.backend import limit_threads
from lmsco_ros.evaluation.environment import machine
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.geometry import is_absent, overlaps
from lmsco_ros.evaluation.session import Request
from lmsco_ros.evaluation.trackers import resolve
from lmsco_ros.evaluation.trackers.configured import ConfiguredTracker
from lmsco_ros.evaluation.trackers.interface import Answer, EvaluatedTracker


@dataclass(frozen=True)
class Race:
    """
    All trackers on one clip.

    Attributes
    ----------
    name : str
        Of the clip.
    seconds : ndarray, shape (n - 1, trackers, 2)
        Processor time and wall time of each update.
    overlap : ndarray, shape (trackers,)
        Mean overlap with the truth: whether they did the same work.
    lost : ndarray, shape (trackers,)
        Share of frames in which the tracker said that the target is lost.

    """

    name: str
    seconds: np.ndarray
    overlap: np.ndarray
    lost: np.ndarray


def build_tracker(name: str) -> EvaluatedTracker:
    """
    Return a tracker by the name of a preset, a YAML file or a peer.

    Raises
    ------
    TrackerError
        When there is none of that name, or it cannot be built here.

    """
    if Path(name).suffix in ('.yaml', '.yml'):
        try:
            return ConfiguredTracker(named_config(name))
        except LMSCOError as error:
            raise TrackerError(f'{name} cannot be built: {error}') from error
    return resolve(name).build()


def buildable(names: Sequence[str]) -> dict[str, EvaluatedTracker]:
    """Return the trackers that can be built; say why others cannot."""
    found = {}
    for name in names:
        try:
            found[name] = build_tracker(name)
        except TrackerError as error:
            print(f'Left out: {error}.\n')
    return found


class Runner:
    """
    A tracker on its way through a clip.

    Parameters
    ----------
    tracker : EvaluatedTracker
        Started on the first frame.
    clip : Clip
        The frames.

    """

    def __init__(self, tracker: EvaluatedTracker, clip: Clip) -> None:
        self.answers: list[Answer] = []
        self._tracker = tracker
        self._frames = iter(clip.frames)
        tracker.initialize(next(self._frames), clip.start)

    def prepare(self) -> None:
        """Fetch the next frame."""
        self._frame = next(self._frames)

    def step(self) -> None:
        """Track into it."""
        self._answer = self._tracker.update(self._frame)

    def note(self) -> None:
        """Keep the answer."""
        self.answers.append(self._answer)


def run_race(trackers: Sequence[EvaluatedTracker], clip: Clip, threads: int) -> Race:
    """Show every frame of a clip to every tracker."""
    runners = [Runner(tracker, clip) for tracker in trackers]
    # Building or starting a tracker may have set the number for the whole process.
    limit_threads(threads)
    seconds = take_turns(runners, len(clip.frames) - 1)
    lost = [np.mean([answer.state is TrackState.LOST for answer in runner.answers])
            for runner in runners]
    return Race(clip.name, seconds,
                np.array([_overlap(clip, runner.answers) for runner in runners]), np.array(lost))


def _overlap(clip: Clip, answers: Sequence[Answer]) -> float:
    """Return the mean overlap over the frames that show the target."""
    boxes = np.array([answer.box.as_tuple() if answer.box else (np.nan,) * 4
                      for answer in answers])
    shown = ~is_absent(clip.truth[1:])
    return float(overlaps(clip.truth[1:][shown], boxes[shown]).mean()) if shown.any() else np.nan


def speed_table(names: Sequence[str], races: Sequence[Race], reference: int, column: int) -> str:
    """Return the times of all updates, and how many the reference takes in the same time."""
    times = 1e3 * np.concatenate([race.seconds[:, :, column] for race in races])
    mean, median = times.mean(axis=0), np.median(times, axis=0)
    late = np.percentile(times, 99, axis=0)
    rows = [(name, float(median[i]), float(mean[i]), float(late[i]), float(late[i] / median[i]),
             float(1e3 / mean[i]), float(median[reference] / median[i]),
             float(mean[reference] / mean[i])) for i, name in enumerate(names)]
    return markdown_table(
        ('tracker', 'median (ms)', 'mean (ms)', 'p99 (ms)', 'p99 / median', 'frames/s',
         f'{names[reference]} / it, medians', f'{names[reference]} / it, means'), rows)


def clip_table(names: Sequence[str], races: Sequence[Race]) -> str:
    """Return, clip by clip, the mean processor time of each tracker, and how well it tracked."""
    rows = [(race.name, len(race.seconds), *(
        f'{1e3 * race.seconds[:, i, PROCESSOR].mean():.1f} '
        f'({race.overlap[i]:.2f}, {race.lost[i]:.0%})' for i in range(len(names))))
        for race in races]
    return markdown_table(('sequence', 'frames', *names), rows)


def main(arguments: list[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--tracker', action='append', help='default and csrt unless given')
    parser.add_argument('--reference', help='what the others are compared with; the last one')
    parser.add_argument('--dataset', type=Path, help='without it a scene is rendered')
    parser.add_argument('--sequences', default='*', help='shell pattern')
    parser.add_argument('--limit', type=positive, help='at most so many sequences')
    parser.add_argument('--frames', type=positive, default=150, help='of each sequence')
    parser.add_argument('--threads', type=positive, default=1)
    options = parser.parse_args(arguments)
    trackers = buildable(options.tracker or ['default', 'csrt'])
    if not trackers:
        parser.exit(1, 'no tracker is left\n')
    names = list(trackers)
    if options.reference and options.reference not in names:
        print(f'{options.reference} is not there to compare with; {names[-1]} takes its place.\n')
    reference = names.index(options.reference) if options.reference in names else len(names) - 1
    request = Request(options.dataset, options.sequences, options.frames)
    clips = (islice(recorded_clips(request), options.limit) if options.dataset
             else [walking_scene(options.frames)])
    races = [run_race(list(trackers.values()), clip, options.threads) for clip in clips]
    if not races:
        parser.exit(1, 'no sequence has two frames with a target\n')
    _report(names, races, reference, options.threads)


def _report(names: Sequence[str], races: Sequence[Race], reference: int, threads: int) -> None:
    """Print the conditions and the tables."""
    frames = sum(len(race.seconds) for race in races)
    print(f'{machine()["processor"]}, {threads} thread(s), OpenCV {cv2.__version__}; '
          f'{len(races)} sequence(s), {frames} updates of each tracker, frame by frame in turn.')
    for title, column in (('Processor time', PROCESSOR), ('Time on the clock', WALL)):
        print(f'\n{title}:\n\n{speed_table(names, races, reference, column)}')
    print('\nMean processor time of each sequence in ms (mean overlap with the truth, share of '
          f'frames LOST):\n\n{clip_table(names, races)}')


if __name__ == '__main__':
    main()
