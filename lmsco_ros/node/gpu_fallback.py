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

"""When the GPU has no memory left, the processor takes over."""

from __future__ import annotations

from collections.abc import Callable
import sys

import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.outcome import Tracker


class FallbackTracker:
    """
    A tracker that is made anew on the processor when the GPU runs out of memory.

    The new one starts on the last frame in which the target was found and goes on from there.
    It stays on the processor: memory that is short once is short again.

    Parameters
    ----------
    make : callable
        Makes a tracker for the device that it is given; empty stands for the configured one.
    device : str
        Where to begin.
    warn : callable
        Called with what happened.

    Raises
    ------
    torch.cuda.OutOfMemoryError
        From every method, when there is none on the processor either.

    """

    def __init__(self, make: Callable[[str], Tracker], device: str,
                 warn: Callable[[str], None]) -> None:
        self._make = make
        self._device = device
        self._warn = warn
        self._found: tuple[npt.NDArray, BoundingBox, float] | None = None
        self._attempt(lambda: self._use(make(device)))

    def initialize(self, image: npt.NDArray, box: BoundingBox, time: float) -> TrackResult:
        """Start on a target in a frame that was taken at a time, in seconds."""
        result = self._attempt(lambda: self._tracker.initialize(image, box, time)) \
            or self._tracker.initialize(image, box, time)
        return self._noted(image, result, time)

    def update(self, image: npt.NDArray, time: float) -> TrackResult:
        """Find the target in the next frame."""
        result = self._attempt(lambda: self._tracker.update(image, time)) \
            or self._resume(image, time)
        return self._noted(image, result, time)

    def _attempt(self, work: Callable[[], TrackResult | None]) -> TrackResult | None:
        """Return what comes of the work; None after a retreat to the processor."""
        try:
            return work()
        except RuntimeError as error:
            if self._device == 'cpu' or not _is_out_of_memory(error):
                raise
            reason = str(error)
        # Not in the handler: the error keeps everything alive that the tracker held.
        self._use(self._make('cpu'))
        self._device = 'cpu'
        torch = sys.modules['torch']
        if torch.cuda.is_available():
            torch.cuda.empty_cache()
        self._warn('the GPU ran out of memory; tracking goes on, slower, on the processor until '
                   f'the node is configured again ({reason})')
        return None

    def _use(self, tracker: Tracker) -> None:
        self._tracker = tracker

    def _resume(self, image: npt.NDArray, time: float) -> TrackResult:
        # Nothing is updated before a start, of which the frame is kept.
        assert self._found is not None
        self._tracker.initialize(*self._found)
        self._found = None
        return self._tracker.update(image, time)

    def _noted(self, image: npt.NDArray, result: TrackResult, time: float) -> TrackResult:
        """Keep the newest frame that shows the target, for as long as there is a way back."""
        if self._device != 'cpu' and result.state is not TrackState.LOST:
            # A copy, as the tracker keeps nothing of an image either: this one may be a part of
            # a larger message, or be written over by the next frame.
            self._found = image.copy(), result.box, time
        return result


def _is_out_of_memory(error: RuntimeError) -> bool:
    """
    Tell whether an error is that of a GPU that has no memory left.

    Only torch raises it, so that torch, which takes long to import, is there when it is.
    """
    torch = sys.modules.get('torch')
    return torch is not None and isinstance(error, torch.cuda.OutOfMemoryError)
