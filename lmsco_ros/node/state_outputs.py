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

"""What a robot steers by: the state of every target, and the ray to the selected one."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from geometry_msgs.msg import PolygonStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.lifecycle.publisher import LifecyclePublisher
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from lmsco_ros.core.types import TrackResult, TrackState
from msg_adapters.boxes import polygon_from_box
from msg_adapters.camera_info import bearing_from_ray, Camera, camera_from_message
from msg_adapters.errors import CameraInfoError
from msg_adapters.state import odometry_from_state, State


class StateOutputs:
    """
    Publishes where targets are and will be; goes on while they are lost.

    Parameters
    ----------
    publisher : callable
        Makes a publisher of a message type and a name.
    warn : callable
        Called with the reason why there is no bearing, once as long as that stays the same.

    """

    def __init__(self, publisher: Callable[[type, str], LifecyclePublisher],
                 warn: Callable[[str], None]) -> None:
        self._camera: Camera | None = None
        self._warn = warn
        self._warned_of = ''
        self._state = publisher(Odometry, 'state')
        self._predicted_box = publisher(PolygonStamped, 'predicted_box')
        self._bearing = publisher(PoseWithCovarianceStamped, 'bearing')

    def calibrate(self, info: CameraInfo) -> None:
        """Take the camera that took the images; while it cannot be used there is no bearing."""
        try:
            self._camera = camera_from_message(info)
        except CameraInfoError as error:
            self._camera = None
            self._warn_once(str(error))

    def publish(self, results: Mapping[int, TrackResult], selected: int,
                size: tuple[int, int], header: Header) -> None:
        """
        Say of one frame where the targets are.

        Parameters
        ----------
        results : mapping of int to TrackResult
            By the numbers of the targets, in pixels of the full image.
        selected : int
            Number of the one whose predicted box and bearing are told.
        size : tuple of int
            Width and height of the full image.
        header : std_msgs/Header
            Of the image.

        """
        states = {number: state for number, result in results.items()
                  if (state := _state(number, result)) is not None}
        for state in states.values():
            self._state.publish(odometry_from_state(state, header))
        if selected not in states:
            return
        predicted = results[selected].predicted_box
        if predicted is not None and results[selected].state is TrackState.LOST:
            self._predicted_box.publish(polygon_from_box(predicted.as_tuple(), header))
        camera = self._camera
        if camera is not None:
            self._publish_bearing(camera, states[selected], size, header)

    def _publish_bearing(self, camera: Camera, state: State, size: tuple[int, int],
                         header: Header) -> None:
        try:
            camera.check_size(size)
            ray = camera.ray(state.center)
        except CameraInfoError as error:
            self._warn_once(str(error))
        else:
            self._bearing.publish(bearing_from_ray(ray, state.covariance, header))

    def _warn_once(self, reason: str) -> None:
        if reason != self._warned_of:
            self._warned_of = reason
            self._warn(reason)


def _state(number: int, result: TrackResult) -> State | None:
    """Return the state that a tracker has told."""
    if (result.predicted_box is None or result.covariance is None or result.velocity is None
            or result.velocity_covariance is None):
        return None
    return State(number, result.predicted_box.center, result.covariance[:2, :2],
                 result.velocity, result.velocity_covariance)
