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

"""The console in its process: node and server started, spun, and taken down."""

from __future__ import annotations

from collections.abc import Sequence
import os
import sys
import threading

import rclpy

from lmsco_ros.console.console_node import ConsoleNode
from lmsco_ros.console.server import serving
from lmsco_ros.console.settings import TOKEN_VARIABLE
from lmsco_ros.extras import MissingExtraError
from lmsco_ros.node.faults import Faults
from lmsco_ros.node.ros_arguments import StartError
from lmsco_ros.node.run import in_ros, living, spin_until

_PAGE = 'docs/console.md'


def run(arguments: Sequence[str], ending: threading.Event) -> int:
    """
    Run the console until the process has to end.

    The token is taken from the environment: everybody on the graph may read parameters.

    Parameters and exit code are those of :func:`lmsco_ros.node.run.run`.
    """
    try:
        with in_ros(arguments), living(ConsoleNode, arguments, _PAGE) as node, serving(
                node.desk, node.settings, os.environ.get(TOKEN_VARIABLE, '')) as address:
            node.get_logger().info(f'the page is at {address}')
            node.get_logger().info(f'waiting for images on {node.desk.image_topic}')
            spin_until(ending, node, Faults(node.get_logger, lambda text: None, rclpy.ok).note)
            return 0
    except (MissingExtraError, StartError) as error:
        print(f'console: {error}', file=sys.stderr)
        return 1
