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

"""Find the sequences below a folder, whatever layout each of them has."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lmsco_ros.evaluation.datasets.frames import image_folder
from lmsco_ros.evaluation.datasets.layouts import FRAME_FOLDERS, Plan, READERS
from lmsco_ros.evaluation.datasets.sequence import TrackingSequence
from lmsco_ros.evaluation.errors import RequestError, SequenceError

_MAX_DEPTH = 3
_UNTOLD = ('frames without ground truth; expected groundtruth.txt, groundtruth_rect.txt, '
           'IR_label.json, infrared.json, infrared.txt, ir.txt or groundTruth_i.txt beside them, '
           'or anno/NAME.txt for frames/NAME '
           '(docs/datasets.md)')


@dataclass(frozen=True)
class BrokenSequence:
    """A folder that looks like a sequence but cannot be used, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class DatasetScan:
    """What was found below a folder, usable and not."""

    sequences: tuple[TrackingSequence, ...]
    broken: tuple[BrokenSequence, ...]


def scan_dataset(root: Path) -> DatasetScan:
    """
    Return every sequence at or below `root`.

    Parameters
    ----------
    root : Path
        A sequence folder, a folder of sequences, or a folder of groups of sequences.

    Returns
    -------
    DatasetScan
        Usable sequences in the order of their names, and the broken ones with the reason.

    Raises
    ------
    RequestError
        When there is no such folder, or nothing in it looks like a sequence.

    """
    if not root.is_dir():
        raise RequestError(f'{root} is not a folder; give the folder of a dataset')
    found = list(_told_apart(_walk(root.resolve(), _MAX_DEPTH)))
    if not found:
        raise RequestError(
            f'{root} holds no sequence; expected folders with groundtruth.txt, '
            'groundtruth_rect.txt or IR_label.json beside frames or a video, or anno/ and '
            'frames/ (docs/datasets.md)')
    return DatasetScan(
        sequences=tuple(item for item in found if isinstance(item, TrackingSequence)),
        broken=tuple(item for item in found if isinstance(item, BrokenSequence)))


def _walk(folder: Path, depth: int) -> Iterator[TrackingSequence | BrokenSequence]:
    name = f'{folder.parent.name}/{folder.name}'
    try:
        plans = next(filter(None, (reader(folder) for reader in READERS)), ())
        untold = any(image_folder(folder / part) for part in FRAME_FOLDERS)
        children = sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError as error:
        yield BrokenSequence(name, str(error))
        return
    if plans:
        yield from map(_read, plans)
    elif untold:
        yield BrokenSequence(name, _UNTOLD)
    elif depth > 0:
        for child in children:
            yield from _walk(child, depth - 1)


def _read(plan: Plan) -> TrackingSequence | BrokenSequence:
    try:
        return plan.read()
    except (SequenceError, OSError) as error:
        return BrokenSequence(f'{plan.group}/{plan.name}', str(error))


def _told_apart(found: Iterable[TrackingSequence | BrokenSequence],
                ) -> Iterator[TrackingSequence | BrokenSequence]:
    """Yield what was found; of several sequences of one name only the first is usable."""
    names: set[str] = set()
    for item in found:
        if isinstance(item, TrackingSequence):
            if item.full_name in names:
                item = BrokenSequence(item.full_name, 'another sequence has this name, by which '
                                      'results are kept; rename its folder, or evaluate it alone')
            else:
                names.add(item.full_name)
        yield item
