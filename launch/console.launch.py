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
# Of the console: type, default and meaning. Text stays text, as a folder may be called 2026-11-27.
PARAMETERS = {
    'host': (str, '127.0.0.1',
             'Where the page is offered; others need LMSCO_CONSOLE_TOKEN to be set'),
    'port': (int, '8080', 'Port of the page'),
    'read_only': (bool, 'false', 'Whether pages may only look'),
    'image_transport': (str, 'raw',
                        "raw or compressed images; the tracker's own is in its params_file"),
    'allowed_origins': (str, '', 'Origins of pages behind a reverse proxy, separated by commas'),
    'record_folder': (str, '', 'Folder for the bags that pages have recorded; empty: they cannot'),
    'history_megabytes': (float, '64.0', 'Images that are kept for stepping back'),
}


def generate_launch_description() -> LaunchDescription:
    """Describe the tracker, which has a launch file of its own, and the page beside it."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'image_topic', default_value='image_raw',
            description='Thermal images to track in and to show (sensor_msgs/Image)'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='Namespace of both nodes and their topics'),
        *(DeclareLaunchArgument(name, default_value=default, description=meaning)
          for name, (_, default, meaning) in PARAMETERS.items()),
        # It takes `image_topic` and `namespace` from here, and its own arguments as well.
        IncludeLaunchDescription(PythonLaunchDescriptionSource(
            str(HERE / 'tracker.launch.py'))),
        Node(
            package='lmsco_ros',
            executable='console',
            namespace=LaunchConfiguration('namespace'),
            name='lmsco_console',
            parameters=[{name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                         for name, (kind, _, _) in PARAMETERS.items()}],
            remappings=[('image_raw', LaunchConfiguration('image_topic'))],
            output='screen',
        ),
    ])
