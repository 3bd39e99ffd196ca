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

"""Start the tracker and the simulated head: `ros2 launch examples/launch/pan_tilt.launch.py`."""

from pathlib import Path
import sys

from launch import LaunchDescription
from launch.actions import ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

REPOSITORY = Path(__file__).resolve().parents[2]


def generate_launch_description() -> LaunchDescription:
    """Describe both; the head waits for the tracker, and speaks on the topics of its defaults."""
    return LaunchDescription([
        # It takes its own arguments from here, such as `params_file`.
        IncludeLaunchDescription(PythonLaunchDescriptionSource(
            str(REPOSITORY / 'launch' / 'tracker.launch.py'))),
        ExecuteProcess(
            cmd=[sys.executable, str(REPOSITORY / 'examples' / 'ros_pan_tilt.py')],
            output='screen'),
    ])
