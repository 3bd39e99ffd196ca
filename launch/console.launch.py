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

"""Start tracker and page: `ros2 launch lmsco_ros console.launch.py image_topic:=/camera/image`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent


def generate_launch_description() -> LaunchDescription:
    """Describe the tracker, which has a launch file of its own, and the page beside it."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'image_topic', default_value='image_raw',
            description='Thermal images to track in and to show (sensor_msgs/Image)'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='Namespace of both nodes and their topics'),
        DeclareLaunchArgument(
            'host', default_value='127.0.0.1',
            description='Where the page is offered; others need LMSCO_CONSOLE_TOKEN to be set'),
        DeclareLaunchArgument(
            'port', default_value='8080', description='Port of the page'),
        DeclareLaunchArgument(
            'read_only', default_value='false', description='Whether pages may only look'),
        # It takes `image_topic` and `namespace` from here, and its own arguments as well.
        IncludeLaunchDescription(PythonLaunchDescriptionSource(
            str(HERE / 'tracker.launch.py'))),
        Node(
            package='lmsco_ros',
            executable='console',
            namespace=LaunchConfiguration('namespace'),
            name='lmsco_console',
            parameters=[{'host': LaunchConfiguration('host'),
                         'port': LaunchConfiguration('port'),
                         'read_only': LaunchConfiguration('read_only')}],
            remappings=[('image_raw', LaunchConfiguration('image_topic'))],
            output='screen',
        ),
    ])
