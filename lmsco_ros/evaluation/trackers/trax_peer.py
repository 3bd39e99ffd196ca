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
Any external tracker that speaks TraX, run as a process of its own.

Needs the `trax` module (`pip install "lmsco_ros[vot]"`). Images travel in memory.
"""

from __future__ import annotations

from dataclasses import dataclass
import hashlib
import importlib
import math
import shlex
import shutil
import subprocess
from typing import Any, IO

import numpy as np
import numpy.typing as npt

from lmsco_ros.core import BoundingBox, TrackState
from lmsco_ros.evaluation.errors import TrackerError
from lmsco_ros.evaluation.trackers.interface import Answer
from lmsco_ros.evaluation.trackers.opencv_image import EightBitView

_SECONDS_TO_QUIT = 5.0


class TraxTracker:
    """
    Client of a TraX server that is started for each target.

    Parameters
    ----------
    command : str
        Command line of the server, which talks over standard input and output.

    """

    in_process = False

    def __init__(self, command: str) -> None:
        """Find the TraX library; the server starts with the first target."""
        self._trax = _import_trax()
        self._command = command
        self._process: subprocess.Popen[bytes] | None = None
        self._client: Any = None
        self._view: EightBitView | None = None

    def initialize(self, image: npt.NDArray, box: BoundingBox) -> None:
        """Start a fresh server on `box`."""
        self.close()
        self._process = subprocess.Popen(
            shlex.split(self._command), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL)
        streams = _pipes(self._process)
        try:
            # The library cannot be called without a log function.
            self._client = self._trax.client.Client(
                stream=tuple(stream.fileno() for stream in streams), log=lambda text: None)
            self._view = EightBitView(image)
            region = self._trax.region.Rectangle.create(*box.as_tuple())
            self._client.initialize(self._images(image), [(region, {})], {})
        except self._trax.TraxException as error:
            raise TrackerError(f'TraX tracker {self._command!r} did not start: {error}; '
                               'run the command by hand to see why') from error

    def update(self, image: npt.NDArray) -> Answer:
        """Send `image` and wait for the region."""
        try:
            objects, _ = self._client.frame(self._images(image), {}, [])
        except self._trax.TraxException as error:
            raise TrackerError(f'TraX tracker {self._command!r} stopped: {error}') from error
        region, properties = objects[0]
        box = self._box(region)
        confidence = properties.get('confidence')
        return Answer(box, float(confidence) if confidence is not None else None,
                      _state(properties.get('state'), box))

    def close(self) -> None:
        """End the server, by force when it does not go by itself."""
        if self._client is not None:
            self._client.quit()
            self._client = None
        if self._process is not None:
            written, read = _pipes(self._process)
            written.close()
            try:
                self._process.wait(_SECONDS_TO_QUIT)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            read.close()
            self._process = None

    def _images(self, image: npt.NDArray) -> dict[str, Any]:
        """Return one image for each channel that the server asked for."""
        assert self._view is not None, 'it starts with `initialize`'
        gray16 = image.ndim == 2 and image.dtype == np.uint16
        sent = image if gray16 or image.dtype == np.uint8 else self._view(image)
        if sent.ndim == 3:
            sent = sent[..., ::-1]
        picture = self._trax.image.MemoryImage.create(np.ascontiguousarray(sent))
        return {channel: picture for channel in self._client.channels}

    def _box(self, region: Any) -> BoundingBox | None:
        if region.type == self._trax.region.Region.POLYGON:
            corners = np.array(list(region))
            low, high = corners.min(axis=0), corners.max(axis=0)
            bounds = (*low, *(high - low))
        elif region.type == self._trax.region.Region.RECTANGLE:
            bounds = region.bounds()
        else:
            return None
        usable = all(map(math.isfinite, bounds)) and bounds[2] > 0 and bounds[3] > 0
        return BoundingBox(*map(float, bounds)) if usable else None


@dataclass(frozen=True)
class TraxSpec:
    """
    An external tracker by its command line.

    Attributes
    ----------
    name : str
        Name in tables.
    command : str
        Command line of the TraX server.

    """

    name: str
    command: str

    @property
    def identity(self) -> str:
        """Digest of the command; the code behind it cannot be seen from here."""
        return f'trax {hashlib.sha256(self.command.encode()).hexdigest()[:12]}'

    def build(self) -> TraxTracker:
        """Return a client, or raise `TrackerError`; the server starts with the first target."""
        client = TraxTracker(self.command)
        try:
            program = shlex.split(self.command)[0]
        except (ValueError, IndexError) as error:
            raise TrackerError(f'tracker trax:{self.name}={self.command} has no command line that '
                               'can be read; expected trax:NAME=COMMAND') from error
        if shutil.which(program) is None:
            raise TrackerError(f'TraX tracker {self.name!r}: there is no program {program!r}; '
                               'give its path, or make it executable')
        return client


def _pipes(process: subprocess.Popen[bytes]) -> tuple[IO[bytes], IO[bytes]]:
    """Return what a process reads from and what it writes to."""
    assert process.stdin is not None and process.stdout is not None, 'it was started with both'
    return process.stdin, process.stdout


def _state(word: str | None, box: BoundingBox | None) -> TrackState:
    """Return what the server says of its state, as ours does, or what the region tells."""
    known: dict[str | None, TrackState] = {state.value: state for state in TrackState}
    return known.get(word, TrackState.LOST if box is None else TrackState.TRACKING)


def _import_trax() -> Any:
    try:
        for module in ('trax.client', 'trax.image', 'trax.region'):
            importlib.import_module(module)
        return importlib.import_module('trax')
    except ImportError as error:
        raise TrackerError('TraX trackers need the trax module: '
                           'pip install "lmsco_ros[vot]"') from error
