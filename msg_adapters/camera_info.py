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
A calibrated camera: pixels -> rays in its optical frame, with what that does to covariances.

The optical frame is that of ROS (REP 103): x right, y down, z forward along the optical axis, its
origin in the center of projection. Positions in the image are those of this package: pixel (0, 0)
covers [0, 1) x [0, 1), so that its center, which calibrations call (0, 0), is (0.5, 0.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
import reprlib
from typing import NamedTuple

import cv2
from geometry_msgs.msg import PoseWithCovarianceStamped
import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from msg_adapters.errors import CameraInfoError

_Array = npt.NDArray[np.float64]

# Numbers of coefficients that each distortion model may have.
_COEFFICIENTS = {
    '': (0,),
    'plumb_bob': (0, 4, 5),
    'rational_polynomial': (0, 4, 5, 8, 12, 14),
    'equidistant': (0, 4),
}
# Steps over which a ray is differentiated, in pixels.
_STEP = 1.0
_NEIGHBORS = _STEP * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], np.float64)
# How far from a pixel its ray may be projected to: farther, the model has no inverse there.
_INVERSE_ERROR = 0.1
# OpenCV ends its search for the inverse early; what is left is made up for so often.
_ROUNDS = 5


class Ray(NamedTuple):
    """
    Direction of what is seen in a pixel.

    Attributes
    ----------
    direction : ndarray, shape (3,)
        Unit vector (x, y, z) in the optical frame of the camera.
    jacobian : ndarray, shape (3, 2)
        Change of `direction` for one pixel right and one pixel down: times a velocity in px/s it
        is the rate of the direction in rad/s.

    """

    direction: _Array
    jacobian: _Array


@dataclass(frozen=True)
class Camera:
    """
    A camera that is calibrated.

    Parameters
    ----------
    model : str
        plumb_bob, rational_polynomial or equidistant; empty without distortion.
    focal, center : tuple of float
        (fx, fy) and (cx, cy) of the matrix K, in pixels of the full sensor.
    coefficients : tuple of float
        Of the distortion, as the model orders them.
    size : tuple of int
        (width, height) of the images that it gives; zeros where that is not told.
    binning, offset : tuple of int
        Pixels of the sensor that make one pixel of the image, and those left of and above it.

    """

    model: str
    focal: tuple[float, float]
    center: tuple[float, float]
    coefficients: tuple[float, ...] = ()
    size: tuple[int, int] = (0, 0)
    binning: tuple[int, int] = (1, 1)
    offset: tuple[int, int] = (0, 0)

    def check_size(self, size: tuple[int, int]) -> None:
        """
        Refuse images of another size (width, height) than those of the calibration.

        Raises
        ------
        CameraInfoError
            When both are known and differ.

        """
        if all(self.size) and size != self.size:
            raise CameraInfoError(
                f'the camera_info is of images of {self.size[0]} x {self.size[1]} pixels, but '
                f'those that come in have {size[0]} x {size[1]}; expected the camera_info of the '
                'same camera, with its binning and region of interest')

    def ray(self, point: Sequence[float]) -> Ray:
        """
        Return the undistorted ray of an image position.

        Parameters
        ----------
        point : (x, y)
            In pixels of the image; may lie outside of it.

        Raises
        ------
        CameraInfoError
            When the model of the distortion has no inverse there.

        """
        pixels = (np.asarray(point, np.float64) + _NEIGHBORS) * self.binning + self.offset - 0.5
        normalized = self._undistorted(pixels)
        missed = np.abs(self._distorted(normalized) - pixels).max()
        if not missed <= _INVERSE_ERROR:
            raise CameraInfoError(
                f'the distortion of the camera_info ({self.model}) has no inverse where the '
                'target is; expected a calibration that holds for the whole image: calibrate '
                'with points up to its edges')
        rays = np.column_stack((normalized, np.ones(len(normalized))))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return Ray(rays[0], np.column_stack((rays[1] - rays[2], rays[3] - rays[4])) / (2 * _STEP))

    @property
    def _matrix(self) -> _Array:
        """The matrix K, shape (3, 3)."""
        return np.array([[self.focal[0], 0.0, self.center[0]],
                         [0.0, self.focal[1], self.center[1]], [0.0, 0.0, 1.0]])

    @property
    def _distortion(self) -> _Array:
        """The coefficients, none of them left out."""
        return np.array(self.coefficients or (0.0,) * 4)

    def _undistorted(self, pixels: _Array) -> _Array:
        """Return pixels of the sensor, shape (n, 2), on the plane at distance 1."""
        undistort = (cv2.fisheye if self.model == 'equidistant' else cv2).undistortPoints
        asked = pixels
        for _ in range(_ROUNDS):
            points = undistort(asked[:, None], self._matrix, self._distortion)
            normalized = np.asarray(points, np.float64)[:, 0]
            asked = asked + pixels - self._distorted(normalized)
        return normalized

    def _distorted(self, normalized: _Array) -> _Array:
        """Return what is on the plane at distance 1 in pixels of the sensor, shape (n, 2)."""
        points = np.column_stack((normalized, np.ones(len(normalized))))[:, None]
        still, matrix, distortion = np.zeros(3), self._matrix, self._distortion
        if self.model == 'equidistant':
            pixels, _ = cv2.fisheye.projectPoints(points, still, still, matrix, distortion)
        else:
            pixels, _ = cv2.projectPoints(points, still, still, matrix, distortion)
        return np.asarray(pixels, np.float64).reshape(-1, 2)


def camera_from_message(info: CameraInfo) -> Camera:
    """
    Return the camera of a message that comes with raw images, which are not rectified.

    Binning and the region of interest of the message are heeded.

    Raises
    ------
    CameraInfoError
        When the camera is not calibrated (K[0] is 0), a number is not finite, or the distortion
        is of an unknown model or has another number of coefficients.

    """
    matrix, coefficients = [float(value) for value in info.k], [float(value) for value in info.d]
    if not matrix[0] or not matrix[4]:
        raise CameraInfoError(
            'the camera_info holds no calibration (K[0] is 0), so that there are no bearings; '
            'calibrate the camera, for example by camera_calibration, and let its driver '
            'publish that')
    if not all(map(math.isfinite, matrix + coefficients)) or min(matrix[0], matrix[4]) < 0:
        raise CameraInfoError('the camera_info has a focal length that is negative or a number '
                              'that is not finite; calibrate the camera anew')
    counts = _COEFFICIENTS.get(info.distortion_model)
    if counts is None:
        known = ', '.join(name for name in _COEFFICIENTS if name)
        raise CameraInfoError('the camera_info has the distortion model '
                              f'{reprlib.repr(info.distortion_model)}; expected one of {known}, '
                              'or none')
    if len(coefficients) not in counts:
        raise CameraInfoError(
            f'the camera_info has {len(coefficients)} coefficients for the distortion model '
            f'"{info.distortion_model}"; expected {" or ".join(map(str, counts))}')
    binning, roi = (info.binning_x or 1, info.binning_y or 1), info.roi
    full = (roi.width or info.width, roi.height or info.height)
    return Camera(
        info.distortion_model, (matrix[0], matrix[4]), (matrix[2], matrix[5]),
        tuple(coefficients), (full[0] // binning[0], full[1] // binning[1]), binning,
        (roi.x_offset, roi.y_offset))


def bearing_from_ray(ray: Ray, covariance: npt.NDArray[np.floating],
                     header: Header | None = None) -> PoseWithCovarianceStamped:
    """
    Return a ray as a pose in the optical frame of the camera.

    Parameters
    ----------
    ray : Ray
        Of the target.
    covariance : ndarray, shape (2, 2)
        Of its place (x, y) in the image, in px^2.
    header : std_msgs/Header, optional
        Of the image; its frame is the optical frame of the camera. Empty by default.

    Notes
    -----
    `position` is the unit vector towards the target: a direction, since nothing is known of the
    distance. Right of the optical axis by atan2(x, z), below it by atan2(y, hypot(x, z)).
    `orientation` is the shortest turn of the optical axis (z) onto the ray, so that a camera
    turned by it looks at the target, without a roll. `covariance` is that of the position, and of
    small turns in rad about the fixed axes x, y, z; row-major, the cross terms included. Both
    parts come from the two numbers of the place in the image: the matrix is of rank 2, and along
    the ray and about it there is no variance.

    """
    x, y, z = ray.direction.tolist()
    message = PoseWithCovarianceStamped(header=header or Header())
    pose = message.pose.pose
    pose.position.x, pose.position.y, pose.position.z = x, y, z
    turn = pose.orientation
    turn.x, turn.y, turn.z, turn.w = _shortest_turn(x, y, z)
    # A small turn t moves the direction d by t x d: that of no roll is d x (its move).
    turning = np.cross(ray.direction, ray.jacobian, axisb=0, axisc=0)
    spread = np.vstack((ray.jacobian, turning))
    message.pose.covariance = (spread @ covariance @ spread.T).ravel()
    return message


def _shortest_turn(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) that turns the axis z onto a unit vector before it."""
    length = math.sqrt(2 * (1 + z))
    return -y / length, x / length, 0.0, length / 2
