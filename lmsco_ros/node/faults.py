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

"""What nobody expects: it costs one request, is told once, and is counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import threading
import time
import traceback
from typing import Protocol

# The same fault is logged again after this time at the earliest.
_QUIET_SECONDS = 5.0
# More different faults than these within that time are no longer told apart.
_MOST_REMEMBERED = 64


class Log(Protocol):
    """The part of a ROS logger that is used."""

    def error(self, message: str) -> object:
        """Write a line that a person should see."""

    def debug(self, message: str) -> object:
        """Write a line for somebody who looks for a mistake."""


class Faults:
    """
    Notes what was raised by work that was given up; may be used by several threads.

    Parameters
    ----------
    log : callable
        Returns where to write.
    count : callable
        Called with the text of every fault.
    is_alive : callable
        Tells whether ROS still runs; while it ends, anything may be raised anywhere.

    """

    def __init__(self, log: Callable[[], Log], count: Callable[[str], None],
                 is_alive: Callable[[], bool]) -> None:
        self._log = log
        self._count = count
        self._is_alive = is_alive
        self._lock = threading.Lock()
        self._told: dict[str, float] = {}

    def note(self, work: str, error: BaseException) -> str:
        """
        Count a fault and log it, unless the same one was just logged; never raises.

        Parameters
        ----------
        work : str
            What was given up, such as ``'a message on /image_raw'``.
        error : BaseException
            What was raised.

        Returns
        -------
        str
            What was raised, and where.

        """
        try:
            reason = cause(error)
            if self._is_alive():
                self._tell(f'{work} was given up, the node goes on: {reason}', error)
        except Exception:  # noqa: B902
            # There may be no memory left even for this.
            return type(error).__name__
        return reason

    def _tell(self, text: str, error: BaseException) -> None:
        self._count(text)
        now = time.monotonic()
        with self._lock:
            is_new = now - self._told.get(text, -_QUIET_SECONDS) >= _QUIET_SECONDS
            if is_new:
                if len(self._told) >= _MOST_REMEMBERED:
                    self._told.clear()
                self._told[text] = now
        if is_new:
            self._log().error(text)
            self._log().debug(''.join(traceback.format_exception(error)))


def cause(error: BaseException) -> str:
    """Return kind, message and place of an error in one line."""
    frames = list(traceback.walk_tb(error.__traceback__))
    message = ' '.join(str(error).split())
    place = ''
    if frames:
        frame, line = frames[-1]
        place = f' ({Path(frame.f_code.co_filename).name}:{line})'
    return type(error).__name__ + (f': {message}' if message else '') + place
