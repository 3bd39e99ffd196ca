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


"""A camera for tests: 640x512 mono16, at most 30 a second, from a line on stdin to the next."""

import sys
import time

import numpy as np
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image

PATIENCE_SECONDS = 100.0


def main(frames: int) -> int:
    rclpy.init()
    node = rclpy.create_node('camera')
    publisher = node.create_publisher(Image, 'image_raw', qos_profile_sensor_data)
    pixels = np.random.default_rng(0).integers(0, 2 ** 14, (512, 640), np.uint16)
    message = Image(height=512, width=640, encoding='mono16', step=1280, data=pixels.tobytes())
    sys.stdin.readline()
    deadline = time.monotonic() + PATIENCE_SECONDS
    while not publisher.get_subscription_count():
        if time.monotonic() > deadline:
            return 1
        rclpy.spin_once(node, timeout_sec=0.05)
    for _ in range(frames):
        # A camera that was held up does not send what it missed in one go.
        time.sleep(1 / 30)
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)
    # Readers copy out of the shared memory that this process owns, so it stays until they have.
    sys.stdin.readline()
    node.destroy_node()
    rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main(int(sys.argv[1])))
