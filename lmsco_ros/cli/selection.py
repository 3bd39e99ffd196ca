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

"""Boxes that a person drags around targets in a window."""

from __future__ import annotations

import os
import re
import sys
from typing import TYPE_CHECKING

from lmsco_ros.cli.console import fail, FAILED, MISUSED

if TYPE_CHECKING:
    import numpy.typing as npt

    from lmsco_ros.core import BoundingBox

_TITLE = 'drag a box, Enter; again for each target; Esc when done'


def require_windows() -> None:
    """Leave with one line that says what to do where no window can be opened."""
    import cv2

    if re.search(r'GUI:\s+NONE', cv2.getBuildInformation()):
        fail('--select needs an OpenCV with windows, this one has none: pip uninstall '
             'opencv-python-headless, pip install opencv-python; or give --init x,y,w,h', FAILED)
    if sys.platform.startswith('linux') and not (
            os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')):
        fail('--select needs a display, and neither DISPLAY nor WAYLAND_DISPLAY names one; start '
             'it on a desktop, or give --init x,y,w,h', FAILED)


def select_boxes(image: npt.NDArray) -> list[BoundingBox]:
    """
    Return the boxes that a person drags in a window, in pixels of the image.

    Parameters
    ----------
    image : ndarray, shape (H, W) or (H, W, 3)
        Shown with 8 bits, small ones enlarged.

    """
    import cv2

    from lmsco_ros.core import BoundingBox
    from lmsco_ros.visualization.display_range import DisplayRange
    from lmsco_ros.visualization.overlay_video import enlargement

    view = DisplayRange().apply(image)
    factor = enlargement(view.shape[0])
    shown = cv2.resize(view, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    try:
        drawn = cv2.selectROIs(_TITLE, shown, showCrosshair=False)
        cv2.destroyAllWindows()
    except cv2.error as error:
        fail(f'no window can be opened ({error.err}); give --init x,y,w,h', FAILED)
    boxes = [tuple(float(value) / factor for value in box) for box in drawn]
    found = [BoundingBox(*box) for box in boxes if box[2] > 0 and box[3] > 0]
    if not found:
        fail('nothing was selected; drag a box and press Enter, or give --init x,y,w,h', MISUSED)
    return found
