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
What a change of the core did to the time of a frame and of its stages.

Two checkouts of the repository track through the same clip, each in a process of its own. They
take turns frame by frame, one waiting while the other works, so that a slow moment of the machine
meets both. Compared are medians of processor time. In the folder of the repository:
git worktree add --detach output/before COMMIT
python -m benchmarks.before_after --before output/before [--config NAME] [--target PIXELS]
    [--frames N]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile

import numpy as np

from benchmarks.measurement import markdown_table, positive, take_turns
from benchmarks.profiling import amortized, FrameProfile, REST
from benchmarks.scenes import Clip, moving_scene, walking_scene
from benchmarks.stages import TRAINING

# Of each checkout its own, which knows the names of its stages.
_PROCESS = Path('benchmarks', 'checkout_process.py')
_SINGLE_THREAD = {'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}
_IMAGE = (1280, 1024)


class Checkout:
    """
    A tracker of one checkout, in its process.

    Parameters
    ----------
    folder : Path
        The checkout.
    config : str
        Preset or YAML file.
    clip : Path
        File with `frames` and `start`.

    """

    def __init__(self, folder: Path, config: str, clip: Path) -> None:
        self.frames: list[FrameProfile] = []
        self._process = subprocess.Popen(
            [sys.executable, str(folder / _PROCESS), config, str(clip)], text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, **_SINGLE_THREAD, 'PYTHONPATH': str(folder.resolve())})

    def prepare(self) -> None:
        """Do nothing: the frames are there."""

    def step(self) -> None:
        """
        Track into the next frame.

        Raises
        ------
        RuntimeError
            When the process has ended.

        """
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            print(file=self._process.stdin, flush=True)
        except BrokenPipeError:
            pass
        self._answer = self._process.stdout.readline()
        if not self._answer:
            raise RuntimeError(f'the tracker ended with status {self._process.wait()}')

    def note(self) -> None:
        """Keep the times of the frame."""
        times = json.loads(self._answer)
        stages = times['stages']
        rest = times['total'] - sum(stages.values())
        self.frames.append(FrameProfile(times['total'], {**stages, REST: rest}, {},
                                        TRAINING in stages))

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def measure(folders: Sequence[Path], config: str, clip: Clip) -> list[list[FrameProfile]]:
    """Return the profiles of all frames after the first, for each checkout."""
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / 'clip.npz'
        np.savez(file, frames=np.stack(clip.frames), start=clip.truth[0])
        checkouts = [Checkout(folder, config, file) for folder in folders]
        try:
            take_turns(checkouts, len(clip.frames) - 1)
        finally:
            for checkout in checkouts:
                checkout.close()
    return [checkout.frames for checkout in checkouts]


def ratio_table(before: Sequence[FrameProfile], after: Sequence[FrameProfile]) -> str:
    """Return the average cost of each stage before and after, and their ratio."""
    def cost(frames: Sequence[FrameProfile], name: str) -> float:
        return 1e3 * amortized(frames, lambda frame: frame.stages.get(name, 0.0))[2]

    names = {name for frame in (*before, *after) for name in frame.stages} - {REST}
    order = sorted(names, key=lambda name: -cost(before, name))
    pairs = [(name, cost(before, name), cost(after, name)) for name in (*order, REST)]
    pairs.append(('**update**', *(1e3 * amortized(frames, lambda frame: frame.total)[2]
                                  for frames in (before, after))))
    return markdown_table(('stage', 'before (ms)', 'after (ms)', 'after / before'), [
        (*pair, pair[2] / pair[1] if pair[1] > 0 else float('nan')) for pair in pairs])


def main(arguments: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--before', type=Path, required=True, help='folder of a checkout')
    parser.add_argument('--after', type=Path, default=Path(__file__).parents[1])
    parser.add_argument('--config', default='default', help='preset or YAML file')
    parser.add_argument('--frames', type=positive, default=300)
    parser.add_argument('--target', type=positive, help='side of a vehicle in a large image, '
                        'in place of the scene of the demonstration')
    options = parser.parse_args(arguments)
    count = options.frames + 1
    clip = (walking_scene(count) if options.target is None
            else moving_scene(_IMAGE, options.target, count))
    before, after = measure((options.before, options.after), options.config, clip)
    print(f'`{options.config}`, {clip.name}, {options.frames} frames, processor time, frame by '
          f'frame in turn\n\n{ratio_table(before, after)}')


if __name__ == '__main__':
    main()
