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
The folder layouts of the benchmarks, each as one pure function.

Every reader answers None for a folder that is not of its layout, raises
`SequenceError` for one that is but cannot be used, and else returns the sequence.
Boxes come out 0-based: (x, y) = (0, 0) is the outer corner of the first pixel.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Callable, Optional

import numpy as np
import numpy.typing as npt

from lmsco_ros.evaluation.datasets.attributes import read_attributes
from lmsco_ros.evaluation.datasets.boxes_text import read_boxes
from lmsco_ros.evaluation.datasets.frames import FrameSource, image_folder, thermal_video
from lmsco_ros.evaluation.datasets.sequence import TrackingSequence
from lmsco_ros.evaluation.errors import SequenceError

Reader = Callable[[Path], Optional[TrackingSequence]]


def read_anti_uav(folder: Path) -> Optional[TrackingSequence]:
    """
    Read Anti-UAV: `IR_label.json` or `infrared.json` beside frames or a video.

    The file holds `exist` (0 or 1 a frame) and `gt_rect` (x, y, width, height, 0-based).
    """
    labels = next((folder / name for name in ('IR_label.json', 'infrared.json')
                   if (folder / name).is_file()), None)
    if labels is None:
        return None
    frames = thermal_video(folder) or _image_folder(folder, ('infrared', 'ir', '.'))
    return _sequence(folder, frames, _json_boxes(labels))


def read_otb(folder: Path) -> Optional[TrackingSequence]:
    """
    Read OTB, PTB-TIR and LSOTB-TIR: `img/` and `groundtruth_rect.txt`.

    These files come from MATLAB, where the first pixel is (1, 1): 1 is taken off x and y.
    """
    labels = folder / 'groundtruth_rect.txt'
    if not labels.is_file():
        return None
    boxes = read_boxes(labels) - (1, 1, 0, 0)
    return _sequence(folder, _image_folder(folder, ('img', 'ir', '.')), boxes)


def read_video(folder: Path) -> Optional[TrackingSequence]:
    """Read one video beside `groundtruth.txt` (0-based, `nan` rows where absent)."""
    labels = folder / 'groundtruth.txt'
    frames = thermal_video(folder) if labels.is_file() else None
    return _sequence(folder, frames, read_boxes(labels)) if frames is not None else None


def read_vot(folder: Path) -> Optional[TrackingSequence]:
    """
    Read VOT: `groundtruth.txt` and frames in the folder that `sequence` names, or `ir/`.

    Without a `sequence` file the frames are looked for in `ir`, `color` and the folder
    itself. Coordinates are used as they are, which is what the VOT toolkit does too.
    """
    labels = folder / 'groundtruth.txt'
    if not labels.is_file():
        return None
    declared = _declared_channels(folder / 'sequence')
    frames = _image_folder(folder, (*declared, 'ir', 'color', '.'))
    return _sequence(folder, frames, read_boxes(labels))


READERS: tuple[Reader, ...] = (read_anti_uav, read_otb, read_video, read_vot)


def _sequence(folder: Path, frames: Optional[FrameSource],
              boxes: npt.NDArray[np.float64]) -> TrackingSequence:
    if frames is None:
        raise SequenceError('ground truth without frames; expected images or a video beside it')
    if len(frames) != len(boxes):
        raise SequenceError(f'{len(frames)} frames but {len(boxes)} rows of ground truth; '
                            'both must have the same number')
    return TrackingSequence(name=folder.name, group=folder.parent.name, frames=frames,
                            ground_truth=boxes, attributes=read_attributes(folder, len(boxes)))


def _image_folder(folder: Path, names: tuple[str, ...]) -> Optional[FrameSource]:
    candidates = (image_folder(folder / name) for name in names)
    return next((frames for frames in candidates if frames is not None), None)


def _declared_channels(description: Path) -> tuple[str, ...]:
    """Return the image folders that a VOT `sequence` file names, the default one first."""
    if not description.is_file():
        return ()
    lines = description.read_text(encoding='utf-8', errors='replace').splitlines()
    entries = dict(line.split('=', 1) for line in lines if '=' in line)
    folders = {key.split('.', 1)[1]: str(Path(value.strip()).parent)
               for key, value in entries.items() if key.startswith('channels.')}
    default = entries.get('channel.default', '').strip()
    return tuple(folders[name] for name in sorted(folders, key=lambda name: name != default))


def _json_boxes(labels: Path) -> npt.NDArray[np.float64]:
    try:
        content = json.loads(labels.read_text(encoding='utf-8', errors='replace'))
        exist, rectangles = content['exist'], content['gt_rect']
        rows = [rectangle if present and len(rectangle) == 4 else [np.nan] * 4
                for present, rectangle in zip(exist, rectangles)]
        boxes = np.array(rows, dtype=float).reshape(-1, 4)
    except (KeyError, TypeError, ValueError) as error:
        raise SequenceError(f'{labels.name}: expected an object with the lists `exist` and '
                            f'`gt_rect`, one entry a frame ({error})') from error
    return np.where((boxes[:, 2:] > 0).all(axis=1, keepdims=True), boxes, np.nan)
