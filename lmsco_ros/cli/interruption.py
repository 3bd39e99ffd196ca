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
Signals that ask a command to end: Ctrl-C, SIGTERM, SIGHUP.

The first one is raised as an exception, so that everything unwinds and files are finished. One
that comes again ends the process at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import signal
import sys
import time
from types import FrameType

# `timeout` and closing terminals send one signal twice.
_ECHO_SECONDS = 0.1
_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption(KeyboardInterrupt):
    """
    Somebody asked the process to end.

    Parameters
    ----------
    number : int
        The signal.

    """

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """
    Raise signals as `Interruption`, and leave with 128 + number once all is unwound.

    What else comes out of the block after a signal came of the signal: an import that was
    broken off, for instance, may say so in an error of its own. Signals that whoever started
    the process has it ignore (`nohup`) stay ignored.

    Raises
    ------
    SystemExit
        After a signal.

    """
    listener = _Listener()
    try:
        yield
    except BaseException:
        if listener.number is None:
            raise
    finally:
        listener.close()
    if listener.number is not None:
        _tell(f'ended by {signal.Signals(listener.number).name}')
        raise SystemExit(128 + listener.number)


class _Listener:
    """
    Handlers for the signals.

    Attributes
    ----------
    number : int or None
        The first signal that came.

    """

    def __init__(self) -> None:
        self.number: int | None = None
        self._since = 0.0
        self._heeded = [number for number in _NUMBERS
                        if signal.getsignal(number) is not signal.SIG_IGN]
        for number in self._heeded:
            signal.signal(number, self._on_signal)

    def close(self) -> None:
        """Let signals end the process at once; there is nothing left to unwind."""
        for number in self._heeded:
            signal.signal(number, _leave)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.number is None:
            self.number, self._since = number, time.monotonic()
            raise Interruption(number)
        if time.monotonic() - self._since > _ECHO_SECONDS:
            _leave(number, frame)


def _leave(number: int, frame: FrameType | None) -> None:
    """End the process by the signal itself."""
    os._exit(128 + number)


def _tell(message: str) -> None:
    try:
        print(message, file=sys.stderr, flush=True)
    except OSError:
        # A terminal that was closed hears nothing.
        pass
