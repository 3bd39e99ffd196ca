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
The folder layouts of the benchmarks, each as one pure function; `docs/datasets.md` shows them.

Every reader answers with the sequences that a folder holds in its layout, none where it is of
another. A sequence is read when it is asked for, and raises `SequenceError` where it cannot be
used. Boxes come out 0-based: (x, y) = (0, 0) is the outer corner of the first pixel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import re

import numpy as np

from lmsco_ros.evaluation.datasets.attributes import read_attributes
from lmsco_ros.evaluation.datasets.boxes_json import read_json_boxes
from lmsco_ros.evaluation.datasets.boxes_text import Boxes, read_boxes
from lmsco_ros.evaluation.datasets.frames import FrameSource, image_folder, thermal_video
from lmsco_ros.evaluation.datasets.sequence import TrackingSequence
from lmsco_ros.evaluation.datasets.text_file import read_lines
from lmsco_ros.evaluation.datasets.visibility import unseen
from lmsco_ros.evaluation.errors import SequenceError

FRAME_FOLDERS = ('ir', 'img', 'color', 'infrared')
# VTUAV tells the box of every tenth frame.
_VTUAV_STEP = 10
# MATLAB's first pixel is (1, 1).
_MATLAB_ORIGIN = (1, 1, 0, 0)
_NUMBERED = re.compile(r'groundtruth_rect\.(\d+)\.txt')

Truth = Callable[[int], Boxes]


@dataclass(frozen=True)
class Plan:
    """
    A sequence that a folder holds.

    Attributes
    ----------
    group, name : str
        What it is called.
    read : callable
        Returns the sequence, or raises `SequenceError`.

    """

    group: str
    name: str
    read: Callable[[], TrackingSequence]


Reader = Callable[[Path], tuple[Plan, ...]]


def read_anti_uav(folder: Path) -> tuple[Plan, ...]:
    """
    Read Anti-UAV: `IR_label.json` or `infrared.json` beside frames or a video.

    The file holds `exist` (0 or 1 a frame) and `gt_rect` (x, y, width, height, 0-based).
    """
    labels = next((folder / name for name in ('IR_label.json', 'infrared.json')
                   if (folder / name).is_file()), None)
    if labels is None:
        return ()
    frames = partial(_frames, folder, ('infrared', 'ir'))
    return (_plan(folder, folder.name, frames, lambda count: read_json_boxes(labels)),)


def read_otb(folder: Path) -> tuple[Plan, ...]:
    """
    Read OTB, PTB-TIR and LSOTB-TIR: `img/` and `groundtruth_rect.txt`.

    These files come from MATLAB, where the first pixel is (1, 1): 1 is taken off x and y.
    Several targets of one recording have a file each, `groundtruth_rect.1.txt` and so on, and
    become sequences of their own.
    """
    labels = {folder / 'groundtruth_rect.txt': folder.name}
    for path in folder.glob('groundtruth_rect.*.txt'):
        numbered = _NUMBERED.fullmatch(path.name)
        labels.update({path: f'{folder.name}-{numbered[1]}'} if numbered else {})
    frames = partial(_frames, folder, ('img', 'ir'))
    return tuple(_plan(folder, name, frames, partial(_matlab_boxes, path))
                 for path, name in sorted(labels.items()) if path.is_file())


def read_rgbt(folder: Path) -> tuple[Plan, ...]:
    """
    Read the infrared channel of RGBT234, LasHeR, VTUAV and GTOT: a label file for each channel.

    `infrared.txt` and `ir.txt` hold x, y, width, height; `groundTruth_i.txt` holds two opposite
    corners. Coordinates are used as they are. The boxes of the visible channel are kept beside.
    """
    for name, (images, truth, other) in _RGBT.items():
        labels, others = folder / name, folder / other
        if labels.is_file():
            frames = partial(_image_folder, folder, images)
            visible = partial(truth, others) if others.is_file() else None
            return (_plan(folder, folder.name, frames, partial(truth, labels), visible),)
    return ()


def read_trackingnet(folder: Path) -> tuple[Plan, ...]:
    """Read TrackingNet: `anno/NAME.txt` and `frames/NAME/`, coordinates as they are."""
    if not ((folder / 'anno').is_dir() and (folder / 'frames').is_dir()):
        return ()
    names = {path.stem for path in (folder / 'anno').glob('*.txt')}
    names |= {path.name for path in (folder / 'frames').iterdir() if path.is_dir()}
    return tuple(
        Plan(folder.name, name, partial(
            _sequence, folder.name, name, folder / 'frames' / name,
            partial(_image_folder, folder / 'frames' / name, ('.',)),
            partial(read_boxes, folder / 'anno' / f'{name}.txt')))
        for name in sorted(names))


def read_groundtruth_txt(folder: Path) -> tuple[Plan, ...]:
    """
    Read VOT, LaSOT, GOT-10k and single videos: `groundtruth.txt` beside frames.

    The frames are in the folder that a VOT file `sequence` names, in `ir`, `img`, `color` or
    `infrared`, in a video, or beside the file, whatever is found first. Coordinates are used
    as they are, which is what the VOT toolkit does too.
    """
    labels = folder / 'groundtruth.txt'
    if not labels.is_file():
        return ()

    def frames() -> FrameSource | None:
        return _frames(folder, (*_declared_channels(folder / 'sequence'), *FRAME_FOLDERS))
    return (_plan(folder, folder.name, frames, partial(read_boxes, labels)),)


READERS: tuple[Reader, ...] = (
    read_anti_uav, read_otb, read_trackingnet, read_groundtruth_txt, read_rgbt)


def _plan(folder: Path, name: str, frames: Callable[[], FrameSource | None],
          truth: Truth, other: Truth | None = None) -> Plan:
    group = folder.parent.name
    return Plan(group, name, partial(_sequence, group, name, folder, frames, truth, other))


def _sequence(group: str, name: str, folder: Path, frames: Callable[[], FrameSource | None],
              truth: Truth, other: Truth | None = None) -> TrackingSequence:
    """
    Return a sequence.

    Parameters
    ----------
    group, name : str
        What it is called.
    folder : Path
        Where files of visibility and attributes are.
    frames : callable
        Returns the frames, or None where there are none.
    truth : callable
        Returns the boxes for a number of frames.
    other : callable, optional
        Returns those of another channel.

    """
    images = frames()
    if images is None:
        raise SequenceError('ground truth without frames; expected images or a video beside it '
                            '(docs/datasets.md)')
    boxes = _as_many(truth, len(images))
    others = None if other is None else _as_many(other, len(images))
    boxes = np.where(unseen(folder, len(boxes))[:, None], np.nan, boxes)
    return TrackingSequence(name=name, group=group, frames=images, ground_truth=boxes,
                            attributes=read_attributes(folder, len(boxes)), other_truth=others)


def _as_many(truth: Truth, frames: int) -> Boxes:
    """Return as many boxes as there are frames, or raise `SequenceError`."""
    boxes = truth(frames)
    if len(boxes) != frames:
        first_only = ' (a test part that tells the first box only cannot be evaluated here)'
        raise SequenceError(f'{frames} frames but {len(boxes)} rows of ground truth; both '
                            f'must have the same number{first_only * (len(boxes) == 1)}')
    return boxes


def _tenth_boxes(labels: Path, frames: int) -> Boxes:
    """Return boxes; those of every tenth frame only are continued between them along lines."""
    boxes = read_boxes(labels)
    if len(boxes) < 2 or len(boxes) != -(-frames // _VTUAV_STEP):
        return boxes
    # Between two frames of which one is without the target there is none either.
    places = np.minimum(np.arange(frames) / _VTUAV_STEP, len(boxes) - 1)
    before = np.floor(places).astype(int)
    after, share = np.ceil(places).astype(int), (places - before)[:, None]
    return (1 - share) * boxes[before] + share * boxes[after]


def _corner_boxes(labels: Path, frames: int) -> Boxes:
    """Return boxes of which two opposite corners are told."""
    corners = read_boxes(labels, frames)
    low, high = np.minimum(corners[:, :2], corners[:, 2:]), np.maximum(
        corners[:, :2], corners[:, 2:])
    return np.concatenate([low, high - low], axis=1)


def _matlab_boxes(labels: Path, frames: int) -> Boxes:
    return read_boxes(labels, frames) - _MATLAB_ORIGIN


def _frames(folder: Path, names: Iterable[str]) -> FrameSource | None:
    """Return images in one of the folders, or a video, or images beside the ground truth."""
    return (_image_folder(folder, names) or thermal_video(folder)
            or image_folder(folder))


def _image_folder(folder: Path, names: Iterable[str]) -> FrameSource | None:
    candidates = (image_folder(folder / name) for name in names)
    return next((frames for frames in candidates if frames is not None), None)


def _declared_channels(description: Path) -> tuple[str, ...]:
    """Return the image folders that a VOT `sequence` file names, the default one first."""
    if not description.is_file():
        return ()
    entries = dict(line.split('=', 1) for line in read_lines(description) if '=' in line)
    folders = {key.split('.', 1)[1]: str(Path(value.strip()).parent)
               for key, value in entries.items() if key.startswith('channels.')}
    default = entries.get('channel.default', '').strip()
    return tuple(folders[name] for name in sorted(folders, key=lambda name: name != default))


# Label file of the infrared channel, to the folders of its images, what its rows mean, and the
# label file of the visible one.
_RGBT: Mapping[str, tuple[tuple[str, ...], Callable[[Path, int], Boxes], str]] = {
    'infrared.txt': (('infrared',), read_boxes, 'visible.txt'),
    'ir.txt': (('ir',), _tenth_boxes, 'rgb.txt'),
    'groundTruth_i.txt': (('i',), _corner_boxes, 'groundTruth_v.txt')}
