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

from collections.abc import Callable, Collection, Mapping
import sys
from typing import TypeVar

import numpy.typing as npt

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.outcome import Tracker

_Done = TypeVar('_Done')


class FallbackTracker:
    """
    A tracker that is made anew on the processor when the GPU runs out of memory.

    The new one starts on the last frame in which each target was found and goes on from there,
    under the same numbers.
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
        # Where each target was seen last, and the number that the present tracker knows it by.
        self._found: dict[int, tuple[npt.NDArray, BoundingBox, float]] = {}
        self._numbers: dict[int, int] = {}
        self._started = 0
        self._attempt(lambda: self._use(make(device)))

    @property
    def results(self) -> dict[int, TrackResult]:
        """What was last said of each target, by its number."""
        return self._outwards(self._tracker.results)

    def initialize(self, image: npt.NDArray, box: BoundingBox, time: float,
                   in_place_of: Collection[int] = ()) -> int:
        """Start on a target in place of others, in a frame taken at a time; return its number."""
        return self._start(image, time, in_place_of, lambda replaced: self._tracker.initialize(
            image, box, time, replaced))

    def initialize_at(self, image: npt.NDArray, point: tuple[float, float], time: float,
                      in_place_of: Collection[int] = ()) -> int:
        """Start on what is at a point (x, y), whatever its extent; else as `initialize`."""
        return self._start(image, time, in_place_of, lambda replaced: self._tracker.initialize_at(
            image, point, time, replaced))

    def update(self, image: npt.NDArray, time: float,
               only: Collection[int] | None = None) -> dict[int, TrackResult]:
        """Find the targets, or only some of them, in their next frame."""
        results = self._attempt(lambda: self._step(image, time, only))
        if results is None:
            self._resume()
            results = self._step(image, time, only)
        self._note(image, time, results)
        return results

    def learn(self) -> None:
        """Learn from the last frame what the next `update` would begin with."""
        if not self._attempt(self._learned):
            self._resume()

    def drop(self, number: int) -> None:
        """Forget a target."""
        self._tracker.drop(self._numbers[number])
        self._forget(number)

    def reset(self) -> None:
        """Forget all targets."""
        self._tracker.reset()
        self._numbers, self._found = {}, {}

    def _start(self, image: npt.NDArray, time: float, in_place_of: Collection[int],
               start: Callable[[Collection[int]], int]) -> int:
        """Start in place of targets, by what takes their numbers in the present tracker."""
        number = self._attempt(lambda: start(self._inwards(in_place_of)))
        if number is None:
            self._resume()
            number = start(self._inwards(in_place_of))
        self._started += 1
        self._numbers[self._started] = number
        for replaced in in_place_of:
            self._forget(replaced)
        self._note(image, time, {self._started: self.results[self._started]})
        return self._started

    def _learned(self) -> bool:
        self._tracker.learn()
        return True

    def _step(self, image: npt.NDArray, time: float,
              only: Collection[int] | None) -> dict[int, TrackResult]:
        return self._outwards(self._tracker.update(
            image, time, None if only is None else self._inwards(only)))

    def _inwards(self, numbers: Collection[int]) -> list[int]:
        return [self._numbers[number] for number in numbers]

    def _outwards(self, results: Mapping[int, TrackResult]) -> dict[int, TrackResult]:
        return {number: results[known] for number, known in self._numbers.items()
                if known in results}

    def _attempt(self, work: Callable[[], _Done]) -> _Done | None:
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

    def _resume(self) -> None:
        """Start anew on every target where it was seen last."""
        found, self._found, self._numbers = self._found, {}, {}
        for number, (image, box, time) in found.items():
            self._numbers[number] = self._tracker.initialize(image, box, time)

    def _note(self, image: npt.NDArray, time: float,
              results: Mapping[int, TrackResult]) -> None:
        """Keep the newest frame that shows each target, for as long as there is a way back."""
        seen = {number: result.box for number, result in results.items()
                if result.state is not TrackState.LOST}
        if self._device != 'cpu' and seen:
            # A copy, as the tracker keeps nothing of an image either: this one may be a part of
            # a larger message, or be written over by the next frame.
            kept = image.copy()
            self._found |= {number: (kept, box, time) for number, box in seen.items()}

    def _forget(self, number: int) -> None:
        self._numbers.pop(number, None)
        self._found.pop(number, None)


def _is_out_of_memory(error: RuntimeError) -> bool:
    """
    Tell whether an error is that of a GPU that has no memory left.

    Only torch raises it, so that torch, which takes long to import, is there when it is.
    """
    torch = sys.modules.get('torch')
    return torch is not None and isinstance(error, torch.cuda.OutOfMemoryError)
