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

"""Start the tracker node: `ros2 launch lmsco_ros tracker.launch.py image_topic:=/camera/image`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import EqualsSubstitution, IfElseSubstitution, LaunchConfiguration
from launch_ros.actions import Node

# Installed as share/lmsco_ros/launch beside share/lmsco_ros/config.
CONFIG = Path(__file__).resolve().parent.parent / 'config'
CAMERAS = CONFIG / 'cameras'


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the one node, which configures and activates itself."""
    return LaunchDescription([
        DeclareLaunchArgument(
            'params_file', default_value=str(CONFIG / 'tracker.yaml'),
            description='Parameters of the node; the default lists and explains all of them. What '
                        'of it is not used is warned of at the start'),
        DeclareLaunchArgument(
            'camera_profile', default_value='none',
            choices=['none', *sorted(profile.stem for profile in CAMERAS.glob('*.yaml'))],
            description='What is known of a camera (config/cameras); counts more than what '
                        'params_file says'),
        DeclareLaunchArgument(
            'image_topic', default_value='image_raw',
            description='Thermal images to track in (sensor_msgs/Image)'),
        DeclareLaunchArgument(
            'camera_info_topic', default_value='camera_info',
            description='Calibration of the camera (sensor_msgs/CameraInfo); makes bearings'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='Namespace of the node and its topics; one for each of several trackers'),
        DeclareLaunchArgument(
            'use_large_image_profile', default_value='false',
            description='Give Fast DDS a 32 MiB shared-memory segment for large images'),
        SetEnvironmentVariable(
            'FASTRTPS_DEFAULT_PROFILES_FILE', str(CONFIG / 'fastdds_large_images.xml'),
            condition=IfCondition(LaunchConfiguration('use_large_image_profile'))),
        Node(
            package='lmsco_ros',
            executable='tracker_node',
            namespace=LaunchConfiguration('namespace'),
            name='lmsco_tracker',
            # The same file once more changes nothing.
            parameters=[LaunchConfiguration('params_file'), IfElseSubstitution(
                EqualsSubstitution(LaunchConfiguration('camera_profile'), 'none'),
                if_value=LaunchConfiguration('params_file'),
                else_value=[f'{CAMERAS}/', LaunchConfiguration('camera_profile'), '.yaml'])],
            remappings=[('image_raw', LaunchConfiguration('image_topic')),
                        ('camera_info', LaunchConfiguration('camera_info_topic'))],
            output='screen',
        ),
    ])
