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
import io
from pathlib import Path
from types import TracebackType

from lmsco_ros.core.types import TrackResult, TrackState

COLUMNS = ('frame', 'stamp', 'x', 'y', 'width', 'height', 'score', 'state', 'id', 'note')


class BoxesFile:
    """
    One row for each target and frame; use as a context manager.

    While the target is lost the row has no box, so that nobody takes the last trusted
    one for a measurement. A row is in the file, and whole, once `add` returns: neither a
    process that is killed nor a full disk leaves half of one.

    Parameters
    ----------
    path : Path
        File to write; it must not exist.

    Raises
    ------
    OSError
        From here, `add` and the end of the block: names the file that cannot be written.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._stream = path.open('xb', buffering=0)
        self._size = 0
        self.rows = 0
        try:
            self._append(COLUMNS)
        except OSError:
            self._stream.close()
            path.unlink()
            raise

    def __enter__(self) -> BoxesFile:
        """Return the open file."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Close the file."""
        try:
            self._stream.close()
        except OSError as late:
            raise OSError(late.errno, late.strerror, str(self._path)) from late

    def add(self, index: int, stamp_ns: int, result: TrackResult, number: int = 1) -> None:
        """Write the row of target `number` in frame `index`; stamps are written in seconds."""
        seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
        box = [''] * 4
        if result.state is not TrackState.LOST:
            box = [f'{value:.3f}' for value in result.box.as_tuple()]
        self._append([index, f'{seconds}.{nanoseconds:09d}', *box,
                      f'{result.score:.4f}', result.state.value, number,
                      result.note])
        self.rows += 1

    def _append(self, values: list[object] | tuple[str, ...]) -> None:
        """Write a row, or nothing of it."""
        text = io.StringIO()
        csv.writer(text, lineterminator='\n').writerow(values)
        rest = text.getvalue().encode()
        try:
            while rest:
                rest = rest[self._stream.write(rest):]
        except OSError as error:
            self._stream.truncate(self._size)
            raise OSError(error.errno, error.strerror, str(self._path)) from error
        self._size = self._stream.tell()
