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
Follow a target live in a camera or a film, in a window.

    python examples/live_opencv.py 0                          # the first camera; mark the target
    python examples/live_opencv.py film.mp4 --box 120,90,40,30

Needs this package and an OpenCV with windows: `pip install opencv-python` in place of
`opencv-python-headless`. Drag a box around the target and press Enter; q ends the loop.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import cv2
import numpy as np

from lmsco_ros.core import LMSCOTracker
from lmsco_ros.visualization.overlay import draw_overlay

WINDOW = 'lmsco_ros'


def frames(source: str) -> Iterator[np.ndarray]:
    """Yield the images of a camera, by its number, or of a film."""
    capture = cv2.VideoCapture(int(source) if source.isdigit() else source)
    try:
        while True:
            arrived, image = capture.read()
            if not arrived:
                return
            yield image
    finally:
        capture.release()


def main(arguments: list[str] | None = None) -> None:
    """Show the box in every frame."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('source', help='number of a camera, or a film')
    parser.add_argument('--box', help='x,y,width,height in the first frame, in pixels')
    options = parser.parse_args(arguments)

    images = frames(options.source)
    first = next(images, None)
    if first is None:
        raise SystemExit(f'{options.source} gives no image; give a camera or a film that opens')
    box = ([float(number) for number in options.box.split(',')] if options.box
           else cv2.selectROI(WINDOW, first))
    tracker = LMSCOTracker()
    tracker.initialize(first, box)
    for image in images:
        result = tracker.update(image)
        cv2.imshow(WINDOW, draw_overlay(image, result))
        if cv2.waitKey(1) == ord('q'):
            break
    cv2.destroyAllWindows()


if __name__ == '__main__':
    main()
