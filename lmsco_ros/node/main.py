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
The command `tracker_node`: the process around the node.

It ends on a signal from its first line on. Therefore nothing that takes long is imported here:
ROS, NumPy and PyTorch come when signals are heeded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
import os
import signal
import sys
import threading
import time
import traceback
from typing import NoReturn

from lmsco_ros.node.ros_arguments import split_arguments

FAILED, MISUSED = 1, 2
# The process has a second. Most of it may be needed for a tracker that does not come back.
_GRACE_SECONDS = 0.8
_HELP = """\
Follow a target through the images of a thermal camera: the ROS 2 node lmsco_tracker.

Everything about the node stands behind --ros-args:
  -r image_raw:=/camera/image_raw    images to listen to
  -r __ns:=/left                     namespace of the node and its topics
  -p preset:=default                 value of a parameter
  --params-file FILE                 values of parameters, see config/tracker.yaml
"""


class Ending:
    """
    Ends the process on SIGINT, SIGTERM or SIGHUP, whatever its other threads are at.

    The signals are blocked, and waited for in a thread of their own: neither an import that
    takes long nor a callback that never returns can keep them from being heeded. Threads
    inherit what is blocked, so this must be started before there are others. SIGHUP stays
    ignored where it is, as with nohup.

    Attributes
    ----------
    requested : threading.Event
        Set when the process has to end.

    """

    def __init__(self) -> None:
        self.requested = threading.Event()
        self._grace = 0.0
        self._signals = {signal.SIGINT, signal.SIGTERM}
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            self._signals.add(signal.SIGHUP)

    def watch(self) -> None:
        """Begin to heed signals: the process ends at once, with code 0."""
        signal.pthread_sigmask(signal.SIG_BLOCK, self._signals)
        threading.Thread(target=self._wait, name='signals', daemon=True).start()

    def allow_clean_up(self) -> None:
        """Leave whoever looks at `requested` a moment to end the process itself."""
        self._grace = _GRACE_SECONDS

    def _wait(self) -> None:
        signal.sigwait(self._signals)
        self.requested.set()
        time.sleep(self._grace)
        os._exit(0)


def main() -> None:
    """Run the node until a signal comes, and end the process: 0 ended, 1 failed, 2 misused."""
    run_program('tracker_node', _serve)


def run_program(name: str, serve: Callable[[Sequence[str], Ending], int]) -> NoReturn:
    """
    Run what serves until a signal comes, and end the process with the code that it returns.

    Parameters
    ----------
    name : str
        Of the program, for what it says.
    serve : callable
        Gets the arguments of the command line, and tells by its code: 0 ended, 1 failed, 2
        misused.

    """
    ending = Ending()
    ending.watch()
    code = FAILED
    try:
        code = serve(sys.argv[1:], ending)
    except BaseException:  # noqa: B902
        code = _unforeseen(name, ending)
    finally:
        # A tracker that is still at work would crash in an interpreter that takes itself down.
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


def _serve(arguments: Sequence[str], ending: Ending) -> int:
    """Answer what needs no node; otherwise run it."""
    own, ros = split_arguments(arguments)
    if own:
        return _answer(own)
    from lmsco_ros.node.installation import obstacle
    remedy = obstacle()
    if remedy:
        return _fail(remedy)
    try:
        from lmsco_ros.node.run import run
    except ImportError as error:
        return _fail(f'{_first_line(error)}; install what is missing, or take the Python that '
                     'the package was installed for')
    ending.allow_clean_up()
    return run(ros, ending.requested)


def _answer(own: Sequence[str]) -> int:
    """Say what is asked for without ROS."""
    import argparse

    import lmsco_ros

    parser = argparse.ArgumentParser(
        'tracker_node', usage='tracker_node [-h] [--version] [--ros-args ...]', description=_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter, add_help=False, allow_abbrev=False)
    parser.add_argument('-h', '--help', action='store_true', help='show this and leave')
    parser.add_argument('--version', action='store_true', help='show the version and leave')
    options, unknown = parser.parse_known_args(own)
    if unknown:
        return _fail(f'{unknown[0]} is not known; what is meant for the node stands behind '
                     '--ros-args, see tracker_node --help', MISUSED)
    print(parser.format_help() if options.help else f'lmsco_ros {lmsco_ros.__version__}')
    return 0


def _unforeseen(name: str, ending: Ending) -> int:
    """Tell of an error of this program; in one line when the process ends anyway."""
    if not ending.requested.is_set():
        traceback.print_exc()
        return FAILED
    error = sys.exc_info()[1]
    print(f'{name}: while ending: {type(error).__name__}: {_first_line(error)}', file=sys.stderr)
    return 0


def _fail(message: str, code: int = FAILED) -> int:
    print(f'tracker_node: {message}', file=sys.stderr)
    return code


def _first_line(error: BaseException | None) -> str:
    return (str(error).splitlines() or [''])[0]


if __name__ == '__main__':
    main()
