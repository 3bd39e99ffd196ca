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
Steer a simulated pan-tilt head onto the target, by the bearing that the tracker node publishes.

    ros2 launch examples/launch/pan_tilt.launch.py    # both at once; or one by one:
    ros2 run lmsco_ros tracker_node                   # elsewhere
    python examples/ros_pan_tilt.py

Needs ROS 2 Jazzy, this package, and a tracker node. The head looks at a part of a rendered scene
and publishes that, its camera_info and a first box; the bearing closes the loop.
"""

from __future__ import annotations

import math
import time

import cv2
from geometry_msgs.msg import PoseWithCovarianceStamped
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, RegionOfInterest

from lmsco_ros.synthetic.scene import render_scene, SceneConfig, SceneFrame
from msg_adapters.boxes import region_from_box
from msg_adapters.image import message_from_image

FOCAL, WIDTH, HEIGHT, INTERVAL, GAIN = 400.0, 240, 192, 1 / 30, 6.0
INFO = CameraInfo(width=WIDTH, height=HEIGHT, distortion_model='plumb_bob', d=[0.0] * 5, k=[
    FOCAL, 0.0, WIDTH / 2 - 0.5, 0.0, FOCAL, HEIGHT / 2 - 0.5, 0.0, 0.0, 1.0])


class PanTiltHead(Node):
    """A camera that looks at a scene; its optical axis begins at a point (x, y) of that."""

    def __init__(self, axis: tuple[float, float], **options: object) -> None:
        super().__init__('pan_tilt_head', **options)
        self._axis, self._rate, self._trim = np.array(axis), np.zeros(2), np.zeros(2)
        self._images, self._infos, self._boxes = self._out = [
            self.create_publisher(kind, topic, 10) for kind, topic in (
                (Image, 'image_raw'), (CameraInfo, 'camera_info'), (RegionOfInterest, 'init_box'))]
        self.create_subscription(
            PoseWithCovarianceStamped, 'lmsco_tracker/bearing', self._steer, 10)

    def is_watched(self) -> bool:
        """Return whether the tracker listens."""
        return all(publisher.get_subscription_count() for publisher in self._out)

    def step(self, frame: SceneFrame) -> float:
        """Turn, publish what is seen, and return how many degrees off the target the axis is."""
        self._axis += FOCAL * INTERVAL * self._rate
        left, top = self._axis - (WIDTH / 2, HEIGHT / 2)
        image = message_from_image(cv2.warpAffine(
            frame.image, np.array([[1, 0, -left], [0, 1, -top]]), (WIDTH, HEIGHT)))
        image.header.stamp.sec, image.header.stamp.nanosec = divmod(frame.stamp_ns, 10**9)
        self._infos.publish(INFO)
        self._images.publish(image)
        if frame.index == 0:
            x, y, width, height = frame.box.as_tuple()
            self._boxes.publish(region_from_box((x - left, y - top, width, height)))
        return math.degrees(math.hypot(*(frame.box.center - self._axis)) / FOCAL)

    def _steer(self, bearing: PoseWithCovarianceStamped) -> None:
        """Turn towards the ray by a proportional and an integral part, critically damped."""
        ray = bearing.pose.pose.position
        angles = np.arctan2((ray.x, ray.y), ray.z)
        self._trim += GAIN**2 / 4 * INTERVAL * angles
        self._rate = GAIN * angles + self._trim


def main() -> None:
    """Follow the target through the scene."""
    rclpy.init()
    head = PanTiltHead((150.0, 160.0))
    try:
        while not head.is_watched():
            rclpy.spin_once(head, timeout_sec=INTERVAL)
        for frame in render_scene(SceneConfig(width=480, height=320)):
            print(f'{head.step(frame):.2f} degrees off')
            end = time.monotonic() + INTERVAL
            while (left := end - time.monotonic()) > 0:
                rclpy.spin_once(head, timeout_sec=left)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        head.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
