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

"""A picture of what the node drew at chosen moments of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
import numpy as np
import numpy.typing as npt

from benchmarks.field_answers import Answers
from benchmarks.joined_recording import FRAMES_PER_SECOND, stamp_of
from lmsco_ros.evaluation.challenges.sensor import SHUTTER_EVERY, SHUTTER_FRAMES
from lmsco_ros.evaluation.geometry import is_absent
from lmsco_ros.evaluation.run_file import SequenceInfo
from lmsco_ros.replay.bags.reader import BagReader, open_bag
from lmsco_ros.replay.bags.stamps import serialized_stamp
from msg_adapters.image import image_from_message

__all__ = ['chosen_moments', 'draw_sheet', 'Moment']

_OVERLAY = '/lmsco_tracker/overlay'
_PARTS_PER_EVENT = 2
_SHOWN = 240, 192
_RIM = 4
_SHUTTER_OPENS = SHUTTER_EVERY + SHUTTER_FRAMES


@dataclass(frozen=True)
class Moment:
    """
    A frame of a part and what it shows.

    Not every frame is drawn: the next drawing stands for it, up to that of the frame `until`.
    """

    title: str
    frame: int
    until: int


@dataclass(frozen=True, eq=False)
class _Row:
    """A part with what was answered, its first frame in the recording, and its moments."""

    part: SequenceInfo
    answers: Answers
    first: int
    moments: Sequence[Moment]


def chosen_moments(part: SequenceInfo) -> list[Moment]:
    """Return what is worth a look in a part: nothing where nothing happens."""
    last = len(part.ground_truth) - 1
    if part.challenge == 'shutter' and last > _SHUTTER_OPENS:
        return [Moment('start', 0, 30), Moment('before', SHUTTER_EVERY - 12, SHUTTER_EVERY - 1),
                Moment('shutter closed', SHUTTER_EVERY + 1, _SHUTTER_OPENS - 1),
                Moment('open again', _SHUTTER_OPENS, min(_SHUTTER_OPENS + 11, last)),
                Moment('later', min(_SHUTTER_OPENS + 30, last), last)]
    absent = np.flatnonzero(is_absent(part.ground_truth))
    if not part.challenge.startswith('disappear') or not len(absent):
        return []
    begin, end = int(absent[0]), int(absent[-1]) + 1
    return [Moment('start', 0, begin - 1), Moment('before the loss', begin - 12, begin - 1),
            Moment('gone', begin + (end - begin) * 2 // 5, end - 1),
            Moment('back', min(end + 3, last), min(end + 29, last)),
            Moment('later', min(end + 30, last), last)]


def draw_sheet(parts: Sequence[SequenceInfo], answers: Sequence[Answers],
               shown: Sequence[bool], bag: Path, path: Path) -> None:
    """
    Draw one row for each of the first parts in which something happens.

    Parameters
    ----------
    parts : sequence of SequenceInfo
        Of the whole recording.
    answers : sequence of Answers
        To the frames of each part.
    shown : sequence of bool
        Which of them may be shown.
    bag : Path
        What the node answered, with overlays.
    path : Path
        Picture to write.

    """
    rows = _rows(parts, answers, shown)
    if not rows:
        return
    columns = max(len(row.moments) for row in rows)
    figure = Figure(figsize=(2.6 * columns, 2.4 * len(rows)), layout='constrained')
    panels = figure.subplots(len(rows), columns, squeeze=False)
    with open_bag(bag) as reader:
        for row, line in zip(rows, panels):
            line[0].set_ylabel(f'{row.part.name}\n{row.part.challenge}', fontsize=9)
            for moment, panel in zip(row.moments, line):
                _draw(panel, row, moment, reader)
    figure.savefig(path, dpi=110, pil_kwargs={'quality': 85})


def _rows(parts: Sequence[SequenceInfo], answers: Sequence[Answers],
          shown: Sequence[bool]) -> list[_Row]:
    """Return the rows, in the order of events."""
    rows: dict[str, list[_Row]] = {}
    first = 0
    for part, answer, visible in zip(parts, answers, shown):
        moments = chosen_moments(part)
        if visible and moments:
            rows.setdefault(part.challenge, []).append(_Row(part, answer, first, moments))
        first += len(part.ground_truth)
    return [row for event in sorted(rows) for row in rows[event][:_PARTS_PER_EVENT]]


def _draw(panel: Axes, row: _Row, moment: Moment, reader: BagReader) -> None:
    """Draw what was drawn of a moment around the target, or around where it was last."""
    panel.set(xticks=[], yticks=[])
    found = _overlay(reader, stamp_of(row.first + moment.frame),
                     stamp_of(row.first + moment.until))
    if found is None:
        panel.set_title(f'{moment.title}: nothing drawn', fontsize=9)
        return
    index, picture = found
    frame = index - row.first
    truth = row.part.ground_truth
    seen = np.flatnonzero(~is_absent(truth[:frame + 1]))[-1]
    panel.imshow(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))
    if seen == frame:
        x, y, width, height = truth[frame]
        panel.add_patch(Rectangle((x - _RIM, y - _RIM), width + 2 * _RIM, height + 2 * _RIM,
                                  fill=False, edgecolor='white', linestyle=':'))
    left, top = _corner(truth[seen], row.part.size)
    panel.set(xlim=(left, left + _SHOWN[0]), ylim=(top + _SHOWN[1], top))
    panel.set_title(f'{moment.title} ({frame / FRAMES_PER_SECOND:.1f} s)\n'
                    f'{row.answers.states[frame]} {row.answers.scores[frame]:.2f}', fontsize=9)


def _corner(box: npt.NDArray[np.float64], size: tuple[int, int]) -> tuple[float, float]:
    """Return the left upper corner of what is shown: around a box, within the image."""
    x, y = box[:2] + box[2:] / 2 - np.array(_SHOWN) / 2
    return (float(np.clip(x, 0, size[0] - _SHOWN[0])), float(np.clip(y, 0, size[1] - _SHOWN[1])))


def _overlay(reader: BagReader, first: int, last: int) -> tuple[int, npt.NDArray[np.uint8]] | None:
    """Return the number of the first frame drawn between two stamps, and the drawing."""
    channels = [item for item in reader.channels if item.topic == _OVERLAY]
    for channel, _, data in reader.messages(channels, start=first):
        at = serialized_stamp(data)
        if at > last:
            return None
        if at >= first:
            message = reader.deserialize(data, channel.msgtype)
            index = round((at - stamp_of(0)) * FRAMES_PER_SECOND * 1e-9)
            return index, image_from_message(message)
    return None
