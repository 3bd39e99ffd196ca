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
Follow a target through frames of degrees Celsius, and tell how warm it is.

    python examples/celsius_frames.py recording.npy --box 120,90,40,30

Needs this package. The recording is an array of shape (frames, height, width) of floating-point
numbers. Pixels without a value are NaN: the tracker leaves them out, and so does the mean here.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lmsco_ros.core import BoundingBox, LMSCOTracker


def temperatures(image: np.ndarray, box: BoundingBox) -> np.ndarray:
    """Return the values under a box, those of whole pixels."""
    left, top = int(box.x), int(box.y)
    return image[top:int(box.y + box.height) + 1, left:int(box.x + box.width) + 1]


def main(arguments: list[str] | None = None) -> None:
    """Print box, mean and highest temperature, score and state of each frame."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('recording', type=Path, help='.npy file')
    parser.add_argument('--box', required=True, help='x,y,width,height in the first frame')
    options = parser.parse_args(arguments)

    # Mapped, not loaded: a long recording need not fit into the memory.
    frames = np.load(options.recording, mmap_mode='r')
    tracker = LMSCOTracker()
    result = tracker.initialize(frames[0], [float(number) for number in options.box.split(',')])
    for number, image in enumerate(frames):
        if number:
            result = tracker.update(image)
        warm = temperatures(image, result.box)
        print(f'{number}: x {result.box.x:.1f} y {result.box.y:.1f}, '
              f'mean {np.nanmean(warm):.1f} C, highest {np.nanmax(warm):.1f} C, '
              f'score {result.score:.2f}, {result.state.value}')


if __name__ == '__main__':
    main()
