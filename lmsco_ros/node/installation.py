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

"""What the node needs beside its own package, found out without importing ROS 2."""

from __future__ import annotations

import importlib
import importlib.util

_PACKAGES = (
    'rclpy', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs',
    'rcl_interfaces', 'sensor_msgs', 'std_msgs', 'std_srvs', 'visualization_msgs')
_ADAPTERS = 'msg_adapters'


def obstacle() -> str:
    """Say why the node cannot run here, and the remedy; empty when everything is there."""
    missing = [name for name in _PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        return (f'the node needs ROS 2, and {", ".join(missing)} is not installed; source a ROS 2 '
                "Jazzy installation, or install the package's extra `ros` (Python 3.10 to 3.12)")
    return _foreign_adapters()


def _foreign_adapters() -> str:
    """Say that another package has the name of our message adapters, if one has."""
    spec = importlib.util.find_spec(_ADAPTERS)
    if spec is None:
        return f'the package {_ADAPTERS} is missing, which comes with lmsco_ros; install it again'
    try:
        owner = getattr(importlib.import_module(_ADAPTERS), 'PART_OF', None)
    except Exception:  # noqa: B902 - Whatever is thrown by code that is not ours.
        owner = None
    if owner == 'lmsco_ros':
        return ''
    place = spec.origin or ', '.join(spec.submodule_search_locations or ())
    return (f'the package {_ADAPTERS} in {place} is not that of lmsco_ros, but comes before it; '
            'take its folder out of PYTHONPATH, or use an environment of its own')
