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
from launch_ros.parameter_descriptions import ParameterValue

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
        DeclareLaunchArgument(
            'image_transport', default_value='raw', choices=['raw', 'compressed'],
            description="What the page shows; the tracker's own is in its params_file"),
        DeclareLaunchArgument(
            'allowed_origins', default_value='',
            description='Origins of pages behind a reverse proxy, separated by commas'),
        DeclareLaunchArgument(
            'record_folder', default_value='',
            description='Folder for the bags that pages have recorded; empty: they cannot'),
        DeclareLaunchArgument(
            'history_megabytes', default_value='64.0',
            description='Images that are kept for stepping back'),
        # It takes `image_topic` and `namespace` from here, and its own arguments as well.
        IncludeLaunchDescription(PythonLaunchDescriptionSource(
            str(HERE / 'tracker.launch.py'))),
        Node(
            package='lmsco_ros',
            executable='console',
            namespace=LaunchConfiguration('namespace'),
            name='lmsco_console',
            parameters=[{
                'host': _given('host', str),
                'port': _given('port', int),
                'read_only': _given('read_only', bool),
                'image_transport': _given('image_transport', str),
                'allowed_origins': _given('allowed_origins', str),
                'record_folder': _given('record_folder', str),
                'history_megabytes': _given('history_megabytes', float)}],
            remappings=[('image_raw', LaunchConfiguration('image_topic'))],
            output='screen',
        ),
    ])


def _given(name: str, kind: type) -> ParameterValue:
    """Return an argument as a parameter of that type: a folder may be called `2026-11-27`."""
    return ParameterValue(LaunchConfiguration(name), value_type=kind)
