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

"""Rays of calibrated cameras against the projection that they undo, and their covariances."""

import math

import cv2
from geometry_msgs.msg import PoseWithCovarianceStamped
from hypothesis import given, strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, RegionOfInterest
from std_msgs.msg import Header

from msg_adapters.camera_info import bearing_from_ray, camera_from_message, Ray
from msg_adapters.errors import CameraInfoError

MATRIX = [400.0, 0.0, 318.0, 0.0, 410.0, 251.0, 0.0, 0.0, 1.0]
DISTORTIONS = {
    'plumb_bob': [-0.31, 0.12, 0.001, -0.002, 0.01],
    'rational_polynomial': [-0.2, 0.05, 0.001, -0.002, 0.01, 0.02, 0.01, 0.003],
    'equidistant': [0.02, -0.01, 0.004, -0.001],
    '': [],
}
MODELS = pytest.mark.parametrize('model', DISTORTIONS)
# Points on the plane at distance 1 that all of these cameras see.
SEEN = st.tuples(st.floats(-0.7, 0.7), st.floats(-0.55, 0.55))
PLACES = st.tuples(st.floats(0, 640), st.floats(0, 512))


def info(model='plumb_bob', **changes):
    """Return the message of a camera."""
    return CameraInfo(**{'width': 640, 'height': 512, 'distortion_model': model, 'k': MATRIX,
                         'd': DISTORTIONS[model]} | changes)


def camera(model, **changes):
    """Return the camera of such a message."""
    return camera_from_message(info(model, **changes))


def projected(model, points):
    """Return image positions of points (x, y, z), shape (n, 3), by OpenCV, as positions here."""
    points, still = np.asarray(points, float)[:, None], np.zeros(3)
    project = (cv2.fisheye if model == 'equidistant' else cv2).projectPoints
    pixels, _ = project(points, still, still, np.reshape(MATRIX, (3, 3)),
                        np.array(DISTORTIONS[model] or [0.0] * 4))
    # OpenCV has the center of the first pixel at 0, and the package at 0.5.
    return pixels.reshape(-1, 2) + 0.5


@MODELS
@given(seen=SEEN)
def test_ray_leads_back_to_the_point(model, seen):
    point = np.array([*seen, 1.0])
    ray = camera(model).ray(projected(model, [point])[0])
    np.testing.assert_allclose(ray.direction, point / np.linalg.norm(point), atol=1e-6)


@MODELS
@given(seen=SEEN, angle=st.floats(0, 2 * math.pi))
def test_jacobian_is_the_change_of_the_ray(model, seen, angle):
    place = projected(model, [[*seen, 1.0]])[0]
    seeing, step = camera(model), 0.25 * np.array([math.cos(angle), math.sin(angle)])
    ray = seeing.ray(place)
    moved = seeing.ray(place + step).direction - seeing.ray(place - step).direction
    np.testing.assert_allclose(ray.jacobian @ (2 * step), moved, atol=2e-7)
    # A direction can only turn.
    np.testing.assert_allclose(ray.direction @ ray.jacobian, 0, atol=1e-6)


@MODELS
def test_optical_axis_goes_through_the_center_of_its_pixel(model):
    np.testing.assert_allclose(camera(model).ray((318.5, 251.5)).direction, (0, 0, 1), atol=1e-9)
    right, below = camera(model).ray((400, 251.5)), camera(model).ray((318.5, 300))
    assert right.direction[0] > 0 and below.direction[1] > 0
    np.testing.assert_allclose(camera(model).ray((318.5, 251.5)).jacobian,
                               [[1 / 400, 0], [0, 1 / 410], [0, 0]], atol=1e-6)


@given(place=PLACES, binning=st.tuples(st.integers(0, 4), st.integers(0, 4)),
       offset=st.tuples(st.integers(0, 99), st.integers(0, 99)))
def test_binning_and_region_of_interest_are_undone(place, binning, offset):
    x, y = (max(1, one) for one in binning)
    part = camera('plumb_bob', binning_x=binning[0], binning_y=binning[1], roi=RegionOfInterest(
        x_offset=offset[0], y_offset=offset[1], width=320, height=240))
    assert part.size == (320 // x, 240 // y)
    seen = (offset[0] + place[0] / 2, offset[1] + place[1] / 2)
    inside = ((seen[0] - offset[0]) / x, (seen[1] - offset[1]) / y)
    np.testing.assert_allclose(part.ray(inside).direction,
                               camera('plumb_bob').ray(seen).direction, atol=1e-9)


def test_size_is_compared_where_it_is_known():
    camera('plumb_bob').check_size((640, 512))
    camera('plumb_bob', width=0, height=0).check_size((320, 240))
    with pytest.raises(CameraInfoError, match='640 x 512.*come in have 320 x 240; expected'):
        camera('plumb_bob').check_size((320, 240))
    camera('plumb_bob', binning_x=2, binning_y=2).check_size((320, 256))


@pytest.mark.parametrize('changes, message', [
    (dict(k=[0.0] * 9), r'no calibration \(K\[0\] is 0\).*calibrate the camera'),
    (dict(k=[400.0, *MATRIX[1:4], 0.0, *MATRIX[5:]]), 'no calibration'),
    (dict(k=[-1.0, *MATRIX[1:]]), 'negative'),
    (dict(k=[math.nan, *MATRIX[1:]]), 'not finite'),
    (dict(d=[math.inf] * 5), 'not finite'),
    (dict(d=[0.1] * 3), '3 coefficients.*"plumb_bob"; expected 0 or 4 or 5'),
    (dict(model='equidistant', d=[0.1] * 5), '5 coefficients.*expected 0 or 4'),
    (dict(distortion_model='pinwheel'), "'pinwheel'; expected one of plumb_bob, rational_poly"),
    (dict(distortion_model='x' * 9999), "'x+\\.\\.\\.x+'; expected")])
def test_what_is_no_calibration_is_refused(changes, message):
    with pytest.raises(CameraInfoError, match=message):
        camera_from_message(info(**changes))


@pytest.mark.parametrize('model, coefficients', [
    ('plumb_bob', [-1.0, 0.0, 0.0, 0.0, 0.0]), ('equidistant', [-0.5, 0.0, 0.0, 0.0])])
def test_place_without_a_ray_is_refused(model, coefficients):
    seeing = camera(model, d=coefficients)
    assert seeing.ray((330.0, 260.0)).direction[2] > 0.99
    with pytest.raises(CameraInfoError, match=f'{model}.* has no inverse.*calibrate with points'):
        seeing.ray((2.0, 2.0))


def unpacked(message):
    """Return direction, turn and covariance of a bearing."""
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    return (np.array([place.x, place.y, place.z]),
            Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]),
            np.reshape(message.pose.covariance, (6, 6)))


@MODELS
@given(place=PLACES)
def test_bearing_points_at_the_target_without_a_roll(model, place):
    ray = camera(model).ray(place)
    direction, turn, _ = unpacked(bearing_from_ray(ray, np.eye(2)))
    np.testing.assert_allclose(direction, ray.direction)
    np.testing.assert_allclose(turn.apply([0, 0, 1]), direction, atol=1e-12)
    assert abs(turn.as_rotvec()[2]) < 1e-12


def test_covariance_is_that_of_many_places():
    rng = np.random.default_rng(0)
    spread = np.array([[9.0, 3.0], [3.0, 4.0]])
    seeing, place = camera('plumb_bob'), np.array([520.0, 120.0])
    message = bearing_from_ray(seeing.ray(place), spread, Header(frame_id='thermal'))
    assert isinstance(message, PoseWithCovarianceStamped) and message.header.frame_id == 'thermal'
    direction, _, covariance = unpacked(message)
    places = rng.multivariate_normal(place, spread, 4000)
    seen = np.array([seeing.ray(each).direction for each in places])
    turned = np.array([np.cross(direction, each) for each in seen])
    dense = np.cov(np.hstack((seen, turned)).T)
    np.testing.assert_allclose(covariance, dense, atol=0.06 * np.abs(dense).max())
    values = np.linalg.eigvalsh(covariance)
    assert values[-2] > 1e-6 and np.abs(values[:4]).max() < 1e-12


def test_rate_of_the_ray_is_the_jacobian_times_the_velocity():
    seeing, velocity, interval = camera('equidistant'), np.array([60.0, -20.0]), 1e-3
    ray = seeing.ray((400.0, 300.0))
    later = seeing.ray(np.array((400.0, 300.0)) + interval * velocity)
    rate = np.linalg.norm(later.direction - ray.direction) / interval
    assert np.linalg.norm(ray.jacobian @ velocity) == pytest.approx(rate, rel=1e-3)


def test_quaternion_is_that_of_the_right_hand():
    """Right of the axis is a turn about y (down), below it a turn about -x."""
    half = math.sqrt(0.5)
    for direction, rotvec in (((half, 0, half), (0, math.pi / 4, 0)),
                              ((0, half, half), (-math.pi / 4, 0, 0))):
        ray = Ray(np.array(direction, float), np.zeros((3, 2)))
        _, turn, _ = unpacked(bearing_from_ray(ray, np.eye(2)))
        np.testing.assert_allclose(turn.as_rotvec(), rotvec, atol=1e-12)
