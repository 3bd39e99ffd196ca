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

"""
Listen to the tracker node: where the target is, and how sure that is.

    ros2 run lmsco_ros tracker_node --ros-args -r image_raw:=/camera/image_raw    # elsewhere
    python examples/ros_subscriber.py

Needs ROS 2 Jazzy, this package, and a tracker node that has a target. No box comes while the
target is lost; the status comes for every frame, and says so.
"""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from msg_adapters.boxes import box_from_polygon
from msg_adapters.status import status_from_message


class TargetListener(Node):
    """
    Hands on a line of text for each message of the tracker.

    Parameters
    ----------
    tell : callable
        Takes the line.
    **options
        Of the node.

    """

    def __init__(self, tell: Callable[[str], None], **options: object) -> None:
        super().__init__('target_listener', **options)
        self._tell = tell
        self.create_subscription(PolygonStamped, 'lmsco_tracker/box', self._on_box, 10)
        self.create_subscription(DiagnosticArray, 'lmsco_tracker/status', self._on_status, 10)

    def _on_box(self, message: PolygonStamped) -> None:
        """Tell the box; its header is that of the image."""
        x, y, width, height = box_from_polygon(message)
        stamp = message.header.stamp
        self._tell(f'{stamp.sec}.{stamp.nanosec:09d}: {width:.0f} x {height:.0f} at '
                   f'({x:.1f}, {y:.1f})')

    def _on_status(self, message: DiagnosticArray) -> None:
        """Tell the state; the adapters read all other figures of the message as well."""
        status = status_from_message(message)
        score = '' if status.score is None else f', score {status.score:.2f}'
        self._tell(f'{status.state}{score}')


def main() -> None:
    """Print until the program is stopped."""
    rclpy.init()
    node = TargetListener(print)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
