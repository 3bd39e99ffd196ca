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

"""The command `console`: the process around the operator's page; see also `lmsco console`."""

from __future__ import annotations

from collections.abc import Sequence
import sys

from lmsco_ros.extras import MissingExtraError, require_extra
from lmsco_ros.node.main import Ending, FAILED, MISUSED, run_program
from lmsco_ros.node.ros_arguments import split_arguments

_HELP = """\
Watch a thermal camera and its tracker in a browser: the ROS 2 node lmsco_console.

Everything about the node stands behind --ros-args:
  -r image_raw:=/camera/image_raw    images to show, those that the tracker gets
  -r __ns:=/left                     namespace, that of the tracker
  -p tracker:=lmsco_tracker          name of the tracker
  -p port:=8080                      port of the page on 127.0.0.1
  -p read_only:=true                 pages may only look
"""


def main() -> None:
    """Run the console until a signal comes, and end the process: 0 ended, 1 failed, 2 misused."""
    run_program('console', _serve)


def _serve(arguments: Sequence[str], ending: Ending) -> int:
    """Answer what needs no node; otherwise run it."""
    own, ros = split_arguments(arguments)
    if own:
        return _answer(own[0])
    from lmsco_ros.node.installation import obstacle
    try:
        remedy = obstacle()
        require_extra('console', 'the page')
    except MissingExtraError as error:
        remedy = str(error)
    if remedy:
        return _fail(remedy)
    from lmsco_ros.console.run import run
    ending.allow_clean_up()
    return run(ros, ending.requested)


def _answer(option: str) -> int:
    """Say what is asked for without ROS."""
    import lmsco_ros

    answers = {'-h': _HELP, '--help': _HELP, '--version': f'lmsco_ros {lmsco_ros.__version__}'}
    if option not in answers:
        return _fail(f'{option} is not known; what is meant for the node stands behind '
                     '--ros-args, see console --help', MISUSED)
    print(answers[option])
    return 0


def _fail(message: str, code: int = FAILED) -> int:
    print(f'console: {message}', file=sys.stderr)
    return code


if __name__ == '__main__':
    main()
