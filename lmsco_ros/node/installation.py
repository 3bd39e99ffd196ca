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

"""What of ROS 2 is installed, found out without importing it."""

from __future__ import annotations

import importlib.util

_PACKAGES = (
    'rclpy', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs',
    'rcl_interfaces', 'sensor_msgs', 'std_msgs', 'std_srvs', 'visualization_msgs')


def without_ros() -> str:
    """Say what the node lacks of ROS 2, and the remedy; empty when everything is there."""
    missing = [name for name in _PACKAGES if importlib.util.find_spec(name) is None]
    if not missing:
        return ''
    return (f'the node needs ROS 2, and {", ".join(missing)} is not installed; source a ROS 2 '
            "Jazzy installation, or install the package's extra `ros`")
