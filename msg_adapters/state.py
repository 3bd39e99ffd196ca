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
The state of a target as `nav_msgs/Odometry`, in pixels, both ways.

The frame of the message is that of the image, with x right and y down in pixels; pixel (0, 0)
covers [0, 1) x [0, 1). The frame of the target, `target_<id>`, has its origin in the center of the
target and the axes of the image, so that the twist, which the message gives in that frame, is in
axes of the image, too.
"""

from __future__ import annotations

from dataclasses import dataclass

from geometry_msgs.msg import Point, Quaternion, Vector3
from nav_msgs.msg import Odometry
import numpy as np
import numpy.typing as npt
from std_msgs.msg import Header

from msg_adapters.errors import StateMessageError

_PREFIX = 'target_'
# Of the largest number that messages have for a target.
_MOST_DIGITS = 10
_SHOWN_LETTERS = 80
# Variance of what an image does not tell (depth, orientation): whoever takes it in learns nothing.
UNKNOWN = 1e9


@dataclass(frozen=True, eq=False)
class State:
    """
    Where a target is, and how it moves.

    Attributes
    ----------
    track_id : int
        Number of the target.
    center : tuple of float
        (x, y) in pixels.
    covariance : ndarray, shape (2, 2)
        Of `center`, in px^2.
    velocity : tuple of float
        (x, y) in px/s.
    velocity_covariance : ndarray, shape (2, 2)
        Of `velocity`, in (px/s)^2.

    """

    track_id: int
    center: tuple[float, float]
    covariance: npt.NDArray[np.float64]
    velocity: tuple[float, float]
    velocity_covariance: npt.NDArray[np.float64]


def odometry_from_state(state: State, header: Header | None = None) -> Odometry:
    """
    Return a state as odometry.

    Parameters
    ----------
    state : State
        Of one target.
    header : std_msgs/Header, optional
        Of the image; empty by default.

    Raises
    ------
    StateMessageError
        When a number is not finite.

    Notes
    -----
    Position and linear velocity have x and y; z is 0 and the orientation that of the image. Both
    covariances are 6x6, row-major, over (x, y, z, turns about x, y, z); all but x and y has the
    variance `UNKNOWN`.

    """
    _check_finite(state)
    message = Odometry(header=header or Header(), child_frame_id=f'{_PREFIX}{state.track_id}')
    message.pose.pose.position = Point(x=float(state.center[0]), y=float(state.center[1]))
    message.pose.pose.orientation = Quaternion(w=1.0)
    message.pose.covariance = _in_plane(state.covariance)
    message.twist.twist.linear = Vector3(x=float(state.velocity[0]), y=float(state.velocity[1]))
    message.twist.covariance = _in_plane(state.velocity_covariance)
    return message


def state_from_odometry(message: Odometry) -> State:
    """
    Return the state that `odometry_from_state` made a message of.

    Raises
    ------
    StateMessageError
        When the child frame is not that of a target, or a number is not finite.

    """
    frame = message.child_frame_id
    number = frame.removeprefix(_PREFIX)
    if number == frame or not (number.isascii() and number.isdigit()) \
            or len(number) > _MOST_DIGITS:
        raise StateMessageError(f'the child frame "{frame[:_SHOWN_LETTERS]}" is not that of a '
                                f'target; expected {_PREFIX}1 or another number')
    place, speed = message.pose.pose.position, message.twist.twist.linear
    state = State(int(number), (place.x, place.y), _of_plane(message.pose.covariance),
                  (speed.x, speed.y), _of_plane(message.twist.covariance))
    _check_finite(state)
    return state


def _check_finite(state: State) -> None:
    """Raise StateMessageError where a number is not finite."""
    numbers = [*state.center, *state.velocity, *np.ravel(state.covariance),
               *np.ravel(state.velocity_covariance)]
    if not np.isfinite(numbers).all():
        raise StateMessageError(f'the state of target {state.track_id} has a number that is not '
                                'finite; expected finite pixels and pixels per second')


def _in_plane(covariance: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the 36 numbers of the covariance of x, y and four that nobody knows."""
    whole = np.diag(np.full(6, UNKNOWN))
    whole[:2, :2] = covariance
    return whole.ravel()


def _of_plane(numbers: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the covariance of x and y."""
    return np.reshape(numbers, (6, 6))[:2, :2].copy()
