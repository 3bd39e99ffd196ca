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

"""Marks that a person set in single frames of a recording, and what follows for the others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from lmsco_ros.evaluation.whole_file import write_whole
from lmsco_ros.replay.bags.output import BagOutput
from msg_adapters.boxes import Box, corners_of_box

MARKED, INTERPOLATED, ABSENT, UNMARKED = 'marked', 'interpolated', 'absent', 'unmarked'
_ABSENT_ROW = 'nan,nan,nan,nan'
_POLYGON = 'geometry_msgs/msg/PolygonStamped'
_TOPIC = '/box'


class Marks:
    """
    Boxes of one target by the number of the frame.

    Between two marked boxes the box is interpolated. From a frame in which the target was
    marked absent it stays so until the next mark. Before the first and after the last mark
    nothing is known.

    Parameters
    ----------
    path : Path
        Ground truth is written there after every change: a row `x,y,width,height` for each
        frame, `nan` where there is no target or nothing is known.
    frames : int
        Rows to write at least.

    """

    def __init__(self, path: Path, frames: int) -> None:
        self._path = path
        self._frames = frames
        self._marks: dict[int, Box | None] = {}

    def __len__(self) -> int:
        """Return the number of marks."""
        return len(self._marks)

    def set(self, index: int, box: Box | None) -> None:
        """Mark a frame with a box, or as one without the target."""
        self._change({**self._marks, index: box})

    def remove(self, index: int) -> None:
        """Take the mark of a frame away."""
        self._change({other: box for other, box in self._marks.items() if other != index})

    def at(self, index: int) -> tuple[str, Box | None]:
        """Return what is known of a frame, and its box if there is one."""
        if index in self._marks:
            box = self._marks[index]
            return (ABSENT if box is None else MARKED), box
        before = max((mark for mark in self._marks if mark < index), default=None)
        after = min((mark for mark in self._marks if mark > index), default=None)
        if before is None:
            return UNMARKED, None
        first = self._marks[before]
        if first is None:
            return ABSENT, None
        last = None if after is None else self._marks[after]
        if after is None or last is None:
            return UNMARKED, None
        share = (index - before) / (after - before)
        mixed = (1 - share) * np.array(first) + share * np.array(last)
        return INTERPOLATED, Box(*(float(value) for value in mixed))

    def write_bag(self, output: BagOutput, stamps: Mapping[int, int]) -> int:
        """
        Write the boxes as polygons on `/box` into a new bag, and return how many there are.

        Parameters
        ----------
        output : BagOutput
            The bag, not opened yet.
        stamps : mapping of int to int
            Stamps of the frames, in nanoseconds; frames without one are left out.

        Raises
        ------
        OutputError
            When the bag cannot be written.

        """
        from rosbags.typesys import get_typestore, Stores

        store = get_typestore(Stores.ROS2_JAZZY)
        types = store.types
        with output:
            connection = output.add_connection(_TOPIC, _POLYGON, typestore=store)
            for index, box in self._boxes():
                if index not in stamps:
                    continue
                seconds, rest = divmod(stamps[index], 10 ** 9)
                header = types['std_msgs/msg/Header'](
                    types['builtin_interfaces/msg/Time'](seconds, rest), '')
                corners = [types['geometry_msgs/msg/Point32'](x, y, 0.0)
                           for x, y in corners_of_box(box)]
                message = types[_POLYGON](header, types['geometry_msgs/msg/Polygon'](corners))
                output.write(connection, stamps[index], store.serialize_cdr(message, _POLYGON))
        return output.count

    def _boxes(self) -> Iterator[tuple[int, Box]]:
        """Yield the frames that have a box."""
        for index in range(max(self._marks, default=-1) + 1):
            _, box = self.at(index)
            if box is not None:
                yield index, box

    def _change(self, marks: dict[int, Box | None]) -> None:
        """Write the marks, and keep them when that was possible."""
        former, self._marks = self._marks, marks
        try:
            boxes = dict(self._boxes())
            count = max(self._frames, max(boxes, default=-1) + 1)
            rows = (','.join(f'{value:.2f}' for value in boxes[index]) if index in boxes
                    else _ABSENT_ROW for index in range(count))
            write_whole(self._path, ''.join(f'{row}\n' for row in rows).encode())
        except OSError:
            self._marks = former
            raise
