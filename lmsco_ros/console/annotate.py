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

"""The page over a recording, without a node: a tool to mark a target."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from pathlib import Path

from lmsco_ros.console.chronicle import Chronicle
from lmsco_ros.console.desk import Desk
from lmsco_ros.console.feed import Rate
from lmsco_ros.console.marks import Marks
from lmsco_ros.console.picture import Pictures
from lmsco_ros.console.recording import Annotator, RecordedFrames, Recording
from lmsco_ros.console.server import serving
from lmsco_ros.console.settings import ConsoleSettings
from lmsco_ros.replay.errors import OutputError
from lmsco_ros.replay.sources import open_source


@contextlib.contextmanager
def annotating(path: Path, output: Path, settings: ConsoleSettings, *, topic: str = '',
               token: str = '') -> Iterator[tuple[str, Marks, Recording]]:
    """
    Offer the page over a recording, and give its address, the marks and the recording.

    Parameters
    ----------
    path : Path
        Folder of images, TIFF stack, film or bag.
    output : Path
        Text file for the marks; it must not exist.
    settings : ConsoleSettings
        Where the page is offered, and to whom.
    topic : str
        Image topic of a bag; may be left out when there is only one.
    token : str
        As for `serving`.

    Raises
    ------
    ReplayError
        When the recording cannot be read, or the file of the marks is there already.
    StartError
        When the page cannot be offered.

    """
    if output.exists():
        raise OutputError(f'{output} is there already; give another name, or move it away')
    recording = Recording(open_source(path, topic=topic))
    marks = Marks(output, len(recording))
    annotator = Annotator(recording, marks)
    pictures = Pictures()
    desk = Desk(
        lambda: RecordedFrames(annotator), Chronicle(pictures.thumbnail), pictures, annotator,
        Rate(), Rate(), str(path), settings.read_only, annotator, len(recording))
    with serving(desk, settings, token) as address:
        yield address, marks, recording
