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

"""Everything that is kept of a run: `boxes.csv`, `overlay.mp4`, `summary.png`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, ExitStack, suppress
import os
from pathlib import Path
from types import TracebackType

from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.frame import RecordedFrame
from lmsco_ros.replay.results_file import BoxesFile
from lmsco_ros.visualization.contact_sheet import ContactSheet, Moment
from lmsco_ros.visualization.overlay_video import OverlayVideo

TABLE, FILM, SUMMARY = 'boxes.csv', 'overlay.mp4', 'summary.png'


class RunOutputs:
    """
    The results of one run in a folder; use as a context manager.

    Nothing is written before the first frame: a run that is refused leaves the folder as it
    was. The first frame takes the place of the results of an earlier run. What was tracked
    before an error is kept.

    Parameters
    ----------
    folder : Path
        Where to write; created when missing. Other files in it are left alone.
    fps : float
        Speed of the film.
    title : str
        Headline of the summary.

    Attributes
    ----------
    folder : Path
        Where the results are.
    replaced : tuple of str
        Names of the files of an earlier run that had to go.

    Raises
    ------
    OutputError
        When a file cannot be written; names it.

    """

    def __init__(self, folder: Path, fps: float, title: str) -> None:
        self.folder = folder
        self._fps = fps
        self._title = title
        self._open = ExitStack()
        self._sheet = ContactSheet()
        self._boxes: BoxesFile | None = None
        self._video: OverlayVideo | None = None
        self._shown = 0
        self.replaced: tuple[str, ...] = ()

    def __enter__(self) -> RunOutputs:
        """Return the outputs."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Finish the files."""
        failed = error is not None
        try:
            with _told():
                self._open.close()
        except OutputError:
            failed = True
            raise
        finally:
            # Of a full disk the first file that suffers is told.
            with suppress(*(OutputError,) if failed else ()):
                self._save_summary()

    @property
    def kept(self) -> str:
        """What has been written so far and where; empty when there is nothing."""
        if self._boxes is None:
            return ''
        pictures = [name for name in (FILM, SUMMARY)
                    if (self.folder / name).is_file() and (self.folder / name).stat().st_size]
        files = ', '.join([f'{TABLE} with {self._boxes.rows} rows', *pictures])
        return f'kept in {self.folder}: {files}'

    def add(self, frame: RecordedFrame, results: Mapping[int, TrackResult],
            truth: BoundingBox | None = None) -> None:
        """
        Append one frame.

        Parameters
        ----------
        frame : RecordedFrame
            The frame.
        results : mapping of int to TrackResult
            What the tracker said of each target, by its number; the summary shows the first.
        truth : BoundingBox, optional
            Where the first one was.

        """
        self.add_rows(frame.index, frame.stamp_ns, results)
        self.add_picture(frame, results, truth)

    def add_rows(self, index: int, stamp_ns: int, results: Mapping[int, TrackResult]) -> None:
        """Append what the tracker said about one frame to the table alone."""
        with _told():
            if self._boxes is None:
                self._make_room()
                self._boxes = self._open.enter_context(BoxesFile(self.folder / TABLE))
            for number, result in results.items():
                self._boxes.add(index, stamp_ns, result, number)

    def add_picture(self, frame: RecordedFrame, results: Mapping[int, TrackResult],
                    truth: BoundingBox | None = None) -> None:
        """Show a frame, whose rows are in the table, in film and summary."""
        with _told():
            if self._video is None:
                film = OverlayVideo(self.folder / FILM, self._fps)
                self._video = self._open.enter_context(film)
            view = self._video.add(frame.image, results, label=str(frame.index), truth=truth)
        self._sheet.add(Moment(frame.index, view, next(iter(results.values())), truth))
        self._shown += 1

    def _make_room(self) -> None:
        """Make the folder, without earlier results: those of two runs are never mixed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.replaced = tuple(name for name in (TABLE, FILM, SUMMARY)
                              if os.path.lexists(self.folder / name))
        for name in self.replaced:
            (self.folder / name).unlink()

    def _save_summary(self) -> None:
        if not self._shown:
            return
        path = self.folder / SUMMARY
        partial = path.with_name(f'.{path.name}')
        try:
            with _told(path):
                self._sheet.save(partial, self._title)
                partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


@contextmanager
def _told(path: Path | None = None) -> Iterator[None]:
    """Turn what the operating system says into words, about `path` where it names no file."""
    try:
        yield
    except OSError as error:
        words = error.strerror or str(error)
        place = path or error.filename
        raise OutputError(f'{f"{place}: " if place else ""}{words}; check the place and its free '
                          'space, or choose another output') from error
