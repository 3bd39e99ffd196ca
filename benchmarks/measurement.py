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

"""Times of things that take turns, and tables of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
import time
from typing import Protocol

import numpy as np

from lmsco_ros.core import TrackerConfig

__all__ = ['CLOCKS', 'Contestant', 'PROCESSOR', 'WALL', 'named_config', 'markdown_table',
           'positive', 'take_turns', 'timed']

PROCESSOR, WALL = 0, 1
"""Columns of `timed`: seconds of all processors for this process, and seconds on the clock."""

CLOCKS = {'processor': time.process_time, 'wall': time.perf_counter}


def timed(function: Callable[[], object]) -> tuple[float, float]:
    """Return the processor time and the wall time of a call, in seconds."""
    wall, processor = time.perf_counter(), time.process_time()
    function()
    return time.process_time() - processor, time.perf_counter() - wall


class Contestant(Protocol):
    """Somebody who takes turns with others."""

    def prepare(self) -> None:
        """Get ready for a step; takes no time of its own."""

    def step(self) -> None:
        """Do what is measured."""

    def note(self) -> None:
        """Take note of the step; takes no time of its own."""


def take_turns(contestants: Sequence[Contestant], rounds: int) -> np.ndarray:
    """
    Let several take one step each in every round, so that a slow moment meets them all.

    Parameters
    ----------
    contestants : sequence of Contestant
        Each round begins with another one: what is left in the caches is everybody's advantage
        in turn.
    rounds : int
        Steps of each.

    Returns
    -------
    ndarray, shape (rounds, len(contestants), 2)
        Processor time and wall time in seconds.

    """
    seconds = np.zeros((rounds, len(contestants), 2))
    for number in range(rounds):
        for place in range(len(contestants)):
            index = (number + place) % len(contestants)
            contestants[index].prepare()
            seconds[number, index] = timed(contestants[index].step)
            contestants[index].note()
    return seconds


def named_config(text: str) -> TrackerConfig:
    """Return the preset of that name, or what the YAML file of that name says."""
    if text in TrackerConfig.preset_names():
        return TrackerConfig.preset(text)
    return TrackerConfig.from_yaml(Path(text))


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; numbers get three significant digits."""
    lines = [header, ['---'] + ['---:'] * (len(header) - 1),
             *([_cell(value) for value in row] for row in rows)]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def _cell(value: object) -> str:
    """Return a number with three digits, or more before the point; anything else as it is."""
    if not isinstance(value, float):
        return str(value)
    if not np.isfinite(value):
        return '–'
    digits = 2 if value == 0 else max(0, 2 - int(np.floor(np.log10(abs(value)))))
    return f'{value:.{min(digits, 3)}f}'


def positive(text: str) -> int:
    """Return a positive number from the command line."""
    number = int(text)
    if number < 1:
        raise ValueError(f'{number} is not positive')
    return number
