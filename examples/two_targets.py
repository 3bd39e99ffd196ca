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
Follow two targets through a folder of images with one tracker.

    python examples/two_targets.py frames/ 120,90,40,30 300,200,25,60

Needs this package. Each target is followed as by a tracker of its own, and one that is lost does
not disturb the other. But they know of each other: where they cross, none is taken for the other.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2

from lmsco_ros.core import MultiTracker, TrackState


def main(arguments: list[str] | None = None) -> None:
    """Print a line for each frame: its name, and a box or the word lost for each target."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('folder', type=Path, help='images, in the order of their names')
    parser.add_argument('boxes', nargs='+', help='x,y,width,height in the first image')
    options = parser.parse_args(arguments)

    tracker = MultiTracker()
    for path in sorted(options.folder.iterdir()):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if tracker.ids:
            tracker.update(image)
        else:
            for box in options.boxes:
                tracker.initialize(image, [float(number) for number in box.split(',')])
        told = ['lost' if result.state is TrackState.LOST else
                '({:.1f}, {:.1f}, {:.1f}, {:.1f})'.format(*result.box.as_tuple())
                for result in tracker.results.values()]
        print(path.name, *told)


if __name__ == '__main__':
    main()
