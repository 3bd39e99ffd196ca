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

"""What commands need that run the node."""

from __future__ import annotations

import importlib.util

from lmsco_ros.cli.console import fail, FAILED


def require_ros() -> None:
    """Leave with the remedy when there is no ROS 2 to run the node with."""
    missing = [name for name in ('rclpy', 'sensor_msgs', 'diagnostic_msgs',
                                 'geometry_msgs', 'visualization_msgs')
               if importlib.util.find_spec(name) is None]
    if missing:
        fail(f'the node needs ROS 2, and {", ".join(missing)} is not installed; source a ROS 2 '
             "Jazzy installation, or install the package's extra `ros`", FAILED)
