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
What a frame of the paper's tracker costs beyond its networks.

The preset `paper` runs end to end, with random weights of the right shapes in a folder of its
own: they cost what the published ones do, and track badly. A vehicle crosses a landscape under a
moving camera, so that the motion network works too. After each frame the same patches go through
the bare networks again; the aim is a frame of at most 1.3 times that. In the folder of the
repository: python -m benchmarks.paper_cost [--frames N] [--target PIXELS]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
import resource
import tempfile

import numpy as np
from safetensors.numpy import save_file

from benchmarks.measurement import CLOCKS, positive
from benchmarks.profiling import amortized, floor_table, profile_track, stage_table
from benchmarks.scenes import moving_scene
from benchmarks.stages import FORWARD
from lmsco_ros.core import TrackerConfig
from lmsco_ros.core.weights.registry import find_source

AIM = 1.3


def write_random_weights(name: str, folder: Path, rng: np.random.Generator) -> None:
    """
    Write weights under which the strength of a signal stays about the same from layer to layer.

    Parameters
    ----------
    name : str
        Of the registry.
    folder : Path
        Where `load_backbone` will look for them.
    rng : numpy.random.Generator
        Decides the weights.

    """
    architecture = find_source(name).architecture
    arrays = {'mean': np.array(architecture.mean, np.float32)}
    for key, shape in architecture.file_shapes().items():
        if key.endswith('.weight'):
            deviation = np.float32((2 / np.prod(shape[1:]))**0.5)
            arrays[key] = deviation * rng.standard_normal(shape, np.float32)
        elif key != 'mean':
            arrays[key] = np.zeros(shape, np.float32)
    save_file(arrays, folder / f'{name}.safetensors')


def paper_config(folder: Path) -> TrackerConfig:
    """Return the preset `paper` with random weights, which are written to `folder`."""
    config = TrackerConfig.preset('paper')
    rng = np.random.default_rng(0)
    for name in (config.networks.appearance_backbone, config.networks.motion_backbone):
        write_random_weights(name, folder, rng)
    return replace(config, networks=replace(config.networks, directory=str(folder)))


def main(arguments: list[str] | None = None) -> None:
    """Print the tables, the ratio and the peak of memory."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--frames', type=positive, default=40)
    parser.add_argument('--target', type=positive, default=42,
                        help='side of the target; five times it is the side of the patches')
    parser.add_argument('--threads', type=positive, default=1)
    parser.add_argument('--clock', choices=CLOCKS, default='processor')
    options = parser.parse_args(arguments)
    clip = moving_scene((640, 512), options.target, options.frames + 1)
    before = _peak_mebibytes()
    with tempfile.TemporaryDirectory() as folder:
        config = paper_config(Path(folder))
        profile = profile_track(config, clip, options.clock, options.threads)
    print(f'`paper` with random weights, target of {options.target} pixels, {options.frames} '
          f'frames, {options.threads} thread(s), {options.clock} time\n')
    print(stage_table(profile.frames), floor_table(profile.frames, (FORWARD,)), sep='\n\n')
    for name, shape in profile.inputs.items():
        print(f'\n{name} sees {shape[0]} x {shape[1]} channels of {shape[2]}x{shape[3]} pixels.')
    ratio = (amortized(profile.frames, lambda frame: frame.total)[2]
             / amortized(profile.frames, lambda frame: frame.floor[FORWARD])[2])
    print(f'\nA frame takes {ratio:.2f} times the bare forward passes of its patches '
          f'(aim: at most {AIM}).')
    print(f'Peak of memory: {_peak_mebibytes():.0f} MiB, {before:.0f} MiB before the tracker.')
    for line in profile.missing:
        print(f'\nNot measured: {line}.')


def _peak_mebibytes() -> float:
    """Return the largest resident size of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == '__main__':
    main()
