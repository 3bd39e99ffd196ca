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
Make a short animated picture of a part of a film: what the README shows of `lmsco demo`.

    python scripts/animation.py output/demo/overlay.mp4 docs/images/demo.webp --part 440 700
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

import cv2
from PIL import Image

from lmsco_ros.media.video import VideoFile

QUALITY = 50


def animate(film: Path, picture: Path, part: tuple[int, int], step: int, width: int) -> None:
    """Write every `step`-th frame of a part of a film, `width` pixels wide, at its own pace."""
    video = VideoFile(film)
    frames = []
    for frame in islice(video, *part, step):
        height = round(width * frame.shape[0] / frame.shape[1])
        small = cv2.resize(frame, (width, height), interpolation=cv2.INTER_AREA)
        frames.append(Image.fromarray(cv2.cvtColor(small, cv2.COLOR_BGR2RGB)))
    frames[0].save(picture, save_all=True, append_images=frames[1:], loop=0, quality=QUALITY,
                   duration=round(1000 * step / video.fps))


def main() -> None:
    """Read the arguments and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('film', type=Path)
    parser.add_argument('picture', type=Path, help='webp or gif')
    parser.add_argument('--part', type=int, nargs=2, default=(0, 300), metavar='FRAME')
    parser.add_argument('--step', type=int, default=3, help='frames from one to the next')
    parser.add_argument('--width', type=int, default=400)
    given = parser.parse_args()
    animate(given.film, given.picture, tuple(given.part), given.step, given.width)


if __name__ == '__main__':
    main()
