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

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from lmsco_ros.core.types import BoundingBox, TrackResult
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.frame import Frame
from lmsco_ros.replay.results_file import BoxesFile
from lmsco_ros.visualization.contact_sheet import ContactSheet, Moment
from lmsco_ros.visualization.overlay_video import OverlayVideo


class RunOutputs:
    """
    The folder of one run; use as a context manager.

    Parameters
    ----------
    folder : Path
        Where to write; created when missing, earlier results are replaced.
    fps : float
        Speed of the film.
    title : str
        Headline of the summary.

    Raises
    ------
    OutputError
        When the folder cannot be written to.

    """

    def __init__(self, folder: Path, fps: float, title: str) -> None:
        self._folder = folder
        self._title = title
        self._open = ExitStack()
        self._sheet = ContactSheet()
        self._is_empty = True
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._boxes = self._open.enter_context(BoxesFile(folder / 'boxes.csv'))
        except OSError as error:
            raise OutputError(f'{folder} cannot be written to ({error}); '
                              'choose another output folder') from error
        self._video = self._open.enter_context(OverlayVideo(folder / 'overlay.mp4', fps))

    def __enter__(self) -> RunOutputs:
        """Return the open outputs."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Finish the files; what was tracked before an error is kept."""
        self._open.close()
        if not self._is_empty:
            self._sheet.save(self._folder / 'summary.png', self._title)

    def add(self, frame: Frame, result: TrackResult, truth: BoundingBox | None = None) -> None:
        """Append one frame with what the tracker said and, where known, the truth."""
        self._is_empty = False
        self._boxes.add(frame.index, frame.stamp_ns, result)
        try:
            view = self._video.add(frame.image, result, label=str(frame.index), truth=truth)
        except OSError as error:
            raise OutputError(str(error)) from error
        self._sheet.add(Moment(frame.index, view, result, truth))
