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
Feed a Kalman filter of your own with the state that the tracker node publishes, and look ahead.

    ros2 launch lmsco_ros tracker.launch.py image_topic:=/camera/image_raw    # elsewhere
    python examples/ros_kalman.py

Needs ROS 2 Jazzy, this package, and a tracker node that has a target. Prints where each target
will be in LOOK_AHEAD seconds, for whoever needs that long to act.
"""

from __future__ import annotations

from collections.abc import Callable

from nav_msgs.msg import Odometry
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from msg_adapters.state import state_from_odometry

LOOK_AHEAD = 0.2
# White noise of acceleration, in px^2/s^3; what is told shares errors from frame to frame, so that
# as many of them as come in a second are taken for one.
MANEUVERS, SHARED = 400.0, 10.0


class ConstantVelocity:
    """Kalman filter over (x, y, dx/dt, dy/dt) in pixels and seconds."""

    def __init__(self, mean: np.ndarray, covariance: np.ndarray, time: float) -> None:
        self.mean, self.covariance, self.time = mean, covariance, time

    def ahead(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and covariance after so many seconds."""
        one, move = np.eye(2), np.eye(4)
        move[:2, 2:] = seconds * one
        noise = MANEUVERS * np.block([[seconds**3 / 3 * one, seconds**2 / 2 * one],
                                      [seconds**2 / 2 * one, seconds * one]])
        return move @ self.mean, move @ self.covariance @ move.T + noise

    def take(self, seen: np.ndarray, covariance: np.ndarray, time: float) -> None:
        """Take a measurement of all four at a time; one of the past changes nothing."""
        if time > self.time:
            mean, known = self.ahead(time - self.time)
            gain = np.linalg.solve(known + covariance, known).T
            self.mean = mean + gain @ (seen - mean)
            self.covariance, self.time = (np.eye(4) - gain) @ known, time


class LookAhead(Node):
    """Hands on a line of text for each state."""

    def __init__(self, tell: Callable[[str], None], **options: object) -> None:
        super().__init__('look_ahead', **options)
        self._tell = tell
        self.filters: dict[int, ConstantVelocity] = {}
        self.create_subscription(Odometry, 'lmsco_tracker/state', self._on_state, 10)

    def _on_state(self, message: Odometry) -> None:
        state, stamp = state_from_odometry(message), message.header.stamp
        seen, spread = np.array([*state.center, *state.velocity]), np.zeros((4, 4))
        spread[:2, :2], spread[2:, 2:] = state.covariance, state.velocity_covariance
        time = stamp.sec + 1e-9 * stamp.nanosec
        known = self.filters.setdefault(state.track_id, ConstantVelocity(seen, spread, time))
        known.take(seen, SHARED * spread, time)
        (x, y, _, _), covariance = known.ahead(LOOK_AHEAD)
        self._tell(f'target {state.track_id} in {LOOK_AHEAD} s: ({x:.1f}, {y:.1f}) within '
                   f'{np.sqrt(np.trace(covariance[:2, :2])):.1f} pixels')


def main() -> None:
    """Print until the program is stopped."""
    rclpy.init()
    node = LookAhead(print)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
