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

"""Time and memory of a single call."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import re
import time

__all__ = ['CallCost', 'call_cost']

_STATUS, _CLEAR = Path('/proc/self/status'), Path('/proc/self/clear_refs')
# Written to the second file, it sets the largest resident size back to the present one.
_FORGET_THE_PEAK = '5'


@dataclass(frozen=True)
class CallCost:
    """
    What a call took.

    Attributes
    ----------
    seconds : float
        Of the processors; other programs do not count.
    mebibytes : float
        By which the resident size of the process grew at its highest.

    """

    seconds: float
    mebibytes: float


def call_cost(function: Callable[[], object]) -> CallCost:
    """Call a function and return what that took; Linux only."""
    _CLEAR.write_text(_FORGET_THE_PEAK, encoding='ascii')
    before, start = _peak_kibibytes(), time.process_time()
    function()
    seconds = time.process_time() - start
    return CallCost(seconds, (_peak_kibibytes() - before) / 1024)


def _peak_kibibytes() -> int:
    """Return the largest resident size of this process since the peak was forgotten."""
    found = re.search(r'VmHWM:\s+(\d+)', _STATUS.read_text(encoding='ascii'))
    assert found is not None
    return int(found[1])
