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

"""What a tracker holds in memory, beyond the libraries."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
import gc
from multiprocessing import get_context
from pathlib import Path
import resource
import tracemalloc

from benchmarks.scenes import moving_scene
from lmsco_ros.core import LMSCOTracker, TrackerConfig
from lmsco_ros.core.backend import limit_threads

__all__ = ['Footprint', 'measure_footprint']

_MEBIBYTE = 1 << 20
_SIZE = (640, 512)
_TARGET = 40
_FURTHER = 4


@dataclass(frozen=True)
class Footprint:
    """
    Memory in MiB, with a full sample memory.

    Attributes
    ----------
    libraries : float
        Resident size of a process that has imported the tracker and tracked nothing.
    first : float
        What the first tracker adds to it, with what the libraries then take for themselves.
    further : float
        What each further tracker adds.
    arrays : float
        Python's and NumPy's memory of one tracker; that of torch is not part of it.
    peak : float
        The same at its highest.

    """

    libraries: float
    first: float
    further: float
    arrays: float
    peak: float


def measure_footprint(config: TrackerConfig) -> Footprint:
    """Measure in a fresh process, whose memory nothing else has used before."""
    with ProcessPoolExecutor(1, mp_context=get_context('spawn')) as pool:
        return pool.submit(_measure, config).result()


def _measure(config: TrackerConfig) -> Footprint:
    """Build one tracker, some more, and one whose arrays are counted."""
    clip = moving_scene(_SIZE, _TARGET, 12)
    frames = config.learning.memory_size + config.learning.update_interval

    def tracker() -> LMSCOTracker:
        built = LMSCOTracker(config)
        limit_threads(1)
        built.initialize(clip.frames[0], clip.start)
        for index in range(1, frames + 1):
            built.update(clip.endless(index))
        return built

    libraries = _resident()
    trackers = [tracker()]
    first = _resident()
    trackers += [tracker() for _ in range(_FURTHER)]
    further = (_resident() - first) / _FURTHER
    tracemalloc.start()
    trackers.append(tracker())
    gc.collect()
    arrays, peak = (size / _MEBIBYTE for size in tracemalloc.get_traced_memory())
    return Footprint(libraries, first - libraries, further, arrays, peak)


def _resident() -> float:
    """Return the resident size of this process in MiB."""
    gc.collect()
    pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
    return pages * resource.getpagesize() / _MEBIBYTE
