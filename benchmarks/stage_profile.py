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
Time of one `update`, stage by stage, and its distance from the floor.

Each stage counts its own time only. The floor is what no implementation of the same tracker
leaves out: the forward passes of the networks and the Fourier transforms, made again right after
each frame, on the same inputs and on their own. Quoted are medians in milliseconds, frames in
which the filter is trained and the others apart. In the folder of the repository:
python -m benchmarks.stage_profile [--config NAME_OR_FILE] [--frames N] [--repetitions N]
"""

from __future__ import annotations

import argparse

from benchmarks.measurement import CLOCKS, named_config, positive
from benchmarks.profiling import floor_table, profile_track, stage_table
from benchmarks.scenes import walking_scene


def main(arguments: list[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--config', default='default', help='preset or YAML file')
    parser.add_argument('--frames', type=positive, default=150)
    parser.add_argument('--repetitions', type=positive, default=3)
    parser.add_argument('--threads', type=positive, default=1)
    parser.add_argument('--clock', choices=CLOCKS, default='processor')
    options = parser.parse_args(arguments)
    config = named_config(options.config)
    clip = walking_scene(options.frames + 1)
    profiles = [profile_track(config, clip, options.clock, options.threads)
                for _ in range(options.repetitions)]
    frames = [frame for profile in profiles for frame in profile.frames]
    print(f'`{options.config}`, {clip.name}, '
          f'{len(frames)} frames, {options.threads} thread(s), {options.clock} time\n')
    print(stage_table(frames), floor_table(frames), sep='\n\n')
    for name, shape in profiles[0].inputs.items():
        print(f'\n{name} sees {shape[0]} x {shape[1]} channels of {shape[2]}x{shape[3]} pixels.')
    for line in profiles[0].missing:
        print(f'\nNot measured: {line}.')


if __name__ == '__main__':
    main()
