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

"""Results as a table: `boxes.csv`."""

from __future__ import annotations

import csv
from pathlib import Path
from types import TracebackType

from lmsco_ros.core.types import TrackResult, TrackState

COLUMNS = ('frame', 'stamp', 'x', 'y', 'width', 'height', 'score', 'state')


class BoxesFile:
    """
    One row a frame; use as a context manager.

    While the target is lost the row has no box, so that nobody takes the last trusted
    one for a measurement.

    Parameters
    ----------
    path : Path
        File to write.

    """

    def __init__(self, path: Path) -> None:
        self._stream = path.open('w', newline='', encoding='utf-8')
        self._writer = csv.writer(self._stream, lineterminator='\n')
        self._writer.writerow(COLUMNS)

    def __enter__(self) -> BoxesFile:
        """Return the open file."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Close the file."""
        self._stream.close()

    def add(self, index: int, stamp_ns: int, result: TrackResult) -> None:
        """Write the row of frame `index`; stamps are written in seconds."""
        seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
        box = [''] * 4
        if result.state is not TrackState.LOST:
            box = [f'{value:.3f}' for value in result.box.as_tuple()]
        self._writer.writerow([index, f'{seconds}.{nanoseconds:09d}', *box,
                               f'{result.score:.4f}', result.state.value])
