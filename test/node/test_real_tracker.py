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


"""The node with the tracker that it is made for."""

from collections.abc import Iterator
from itertools import islice
from types import SimpleNamespace

import cv2
from geometry_msgs.msg import Point, PointStamped, PolygonInstanceStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from scipy.stats import chi2
from sensor_msgs.msg import Image

from lmsco_ros.core.types import BoundingBox
from lmsco_ros.evaluation.challenges.regions import without_region
from lmsco_ros.node.tracker_factory import make_tracker
from lmsco_ros.synthetic import render_scene, SceneConfig
from msg_adapters.boxes import box_from_polygon
from msg_adapters.state import state_from_odometry

SHAPE = (96, 128)


def _scene(number: int) -> np.ndarray:
    """Return 16-bit counts with a warm blob that moves by (2, 1) pixels a frame."""
    rows, columns = np.mgrid[:SHAPE[0], :SHAPE[1]]
    x, y = 40 + 2 * number, 40 + number
    texture = 40 * np.sin(rows / 5) * np.cos(columns / 7)
    blob = 900 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 50)
    return (8000 + texture + blob).astype(np.uint16)


def _image(graph, number):
    message = graph.image(shape=SHAPE)
    np.frombuffer(message.data, np.uint16).reshape(SHAPE)[:] = _scene(number)
    return message


def test_warm_target_is_followed(run):
    running = run(tracker_factory=make_tracker, preset='default')
    running.start(30, 30, 20, 20)
    for number in range(15):
        assert running.send(_image(running.graph, number)).state == 'tracking'
        x, y, width, height = running.last_box
        assert x + width / 2 == pytest.approx(40.5 + 2 * number, abs=2)
        assert y + height / 2 == pytest.approx(40.5 + number, abs=2)


def test_two_targets_are_followed(run):
    """They look the same; the second is started while the first is followed."""
    running = run(tracker_factory=make_tracker, max_targets=2)
    boxes = running.graph.listen(PolygonInstanceStamped, 'lmsco_tracker/boxes')

    def both(number):
        message = _image(running.graph, number)
        pixels = np.frombuffer(message.data, np.uint16).reshape(SHAPE)
        np.maximum(pixels, np.roll(_scene(20 - number), 20, axis=0), out=pixels)
        return message
    running.start(30, 30, 20, 20)
    running.send(both(0))
    running.start(70, 70, 20, 20)
    images = [both(number) for number in range(1, 21)]
    last = running.send(*images)
    running.graph.spin_until(lambda: sum(
        box.header == images[-1].header for box in boxes) >= 2)
    found = {box.polygon.id: box_from_polygon(SimpleNamespace(polygon=box.polygon.polygon))
             for box in boxes if box.header == images[-1].header}
    assert last.state == 'tracking' and set(found) == {1, 2}
    for number, (x, y) in {1: (80.5, 60.5), 2: (40.5, 60.5)}.items():
        left, top, width, height = found[number]
        assert (left + width / 2, top + height / 2) == pytest.approx((x, y), abs=2)


@pytest.fixture
def points(run):
    """Return a node, and a publisher of points to start on."""
    running = run(tracker_factory=make_tracker)
    return running, running.graph.publisher(PointStamped, 'init_point')


def test_what_is_at_a_point_is_followed_and_its_motion_told(points):
    running, clicks = points
    states = running.graph.listen(Odometry, 'lmsco_tracker/state')
    clicks.publish(PointStamped(point=Point(x=40.5, y=40.5)))
    running.settle()
    for number in range(25):
        image = _image(running.graph, number)
        assert running.send(image).state == 'tracking'
    state = state_from_odometry(running.graph.answer(states, image))
    # By (2, 1) pixels in 33 ms; the blob has no edge, so its center is known to some pixels.
    assert state.center == pytest.approx((88.5, 64.5), abs=4)
    assert state.velocity == pytest.approx((2 / 0.033, 1 / 0.033), abs=6)
    assert np.linalg.eigvalsh(state.covariance).min() > 0
    assert np.linalg.eigvalsh(state.velocity_covariance).min() > 0


def test_state_is_within_its_covariance_seen_and_coasting_for_a_second(run):
    """A warm ellipse on a line, away from frame 50 to 79; judged by chi square of two numbers."""
    running = run(tracker_factory=make_tracker)
    states = running.graph.listen(Odometry, 'lmsco_tracker/state')
    rng = np.random.default_rng(0)
    ground = 8000 + 600 * cv2.GaussianBlur(rng.normal(0, 1, (240, 320)), (0, 0), 6)
    rows, columns = np.mgrid[:240, :320] + 0.5
    running.start(51, 46, 18, 28)
    spreads, far = {'tracking': [], 'uncertain': [], 'lost': []}, []
    for number in range(95):
        truth = np.array([60 + 2.0 * number, 60 + 1.0 * number])
        scene = ground.copy()
        if not 50 <= number < 80:
            scene[((columns - truth[0]) / 9)**2 + ((rows - truth[1]) / 14)**2 < 1] = 9000
        scene = cv2.GaussianBlur(scene, (0, 0), 1) + rng.normal(0, 5, scene.shape)
        image = running.graph.image(shape=scene.shape)
        np.frombuffer(image.data, np.uint16).reshape(scene.shape)[:] = scene
        said = running.send(image).state
        state = state_from_odometry(running.graph.answer(states, image))
        error = np.subtract(state.center, truth)
        far.append(error @ np.linalg.solve(state.covariance, error))
        spreads[said].append(np.trace(state.covariance))
    assert max(far) < chi2.ppf(0.99, 2)
    assert len(spreads['lost']) > 20 and (np.diff(spreads['lost']) > 0).all()
    # A side of the target at most after a second, and much less while it is seen.
    assert max(spreads['tracking'][1:]) < 0.05 * max(spreads['lost']) < 28**2


def _walk(seed: int) -> Iterator[tuple[np.ndarray, BoundingBox]]:
    """Yield images and true boxes of a walker, who is out of the picture for the last second."""
    rng = np.random.default_rng(seed)
    scene = render_scene(SceneConfig(320, 256, seed=seed, target_height=0.25))
    for frame in islice(scene, 30, 110):
        image, around = frame.image, np.array(frame.box.scaled(1.3).as_tuple())
        yield image if frame.index < 80 else without_region(image, around, rng), frame.box


def test_errors_in_rendered_scenes_are_within_what_the_state_says(run):
    """Frames of one scene share errors: each scene is one draw, judged by chi square."""
    running, seen, coasting = run(tracker_factory=make_tracker), [], []
    states = running.graph.listen(Odometry, 'lmsco_tracker/state')
    for seed in range(1, 5):
        told = []
        for image, box in _walk(seed):
            message = running.graph.image(shape=image.shape)
            np.frombuffer(message.data, np.uint16).reshape(image.shape)[:] = image
            if not told:
                stamp = message.header.stamp
                running.start_stamped(box.as_tuple(), stamp.sec * 10**9 + stamp.nanosec)
            said = running.send(message).state
            state = state_from_odometry(running.graph.answer(states, message))
            error = np.subtract(state.center, box.center)
            told.append((said, error @ np.linalg.solve(state.covariance, error)))
            # It says something: in sides of the target, also after a second without it.
            side = np.sqrt(np.trace(state.covariance) / 2 / box.area)
            assert side < (1 if said == 'lost' else 0.2)
        assert [said for said, _ in told[:50] + told[-25:]] == 50 * ['tracking'] + 25 * ['lost']
        far = np.array([distance for _, distance in told])
        assert np.mean(far < chi2.ppf(0.95, 2)) > 0.95
        seen.append(far[1:50].mean())
        coasting.append(far[-1])
    assert max(sum(seen), sum(coasting)) < chi2.ppf(0.975, 2 * len(seen))


def test_point_where_nothing_is_is_refused(points):
    running, clicks = points
    clicks.publish(PointStamped(point=Point(x=2000.5, y=40.5)))
    running.settle()
    status = running.send(_image(running.graph, 0))
    assert (status.start, status.state) == ('refused', 'refused')
    assert 'not in the image of 128 x 96 pixels' in status.message


def test_refused_box_is_reported_and_costs_nothing(run):
    running = run(tracker_factory=make_tracker)
    running.start(5000, 5000, 20, 20)
    status = running.send(_image(running.graph, 0))
    assert status.state == 'refused' and 'of its area in the image' in status.message
    assert not running.boxes
    running.start(30, 30, 20, 20)
    first = running.send(_image(running.graph, 1))
    assert first.state == 'tracking'
    running.start(5000, 5000, 20, 20)
    states = [running.send(_image(running.graph, number)) for number in range(2, 5)]
    assert states[-1].state == 'tracking' and states[-1].track_id == first.track_id


def test_frame_of_another_size_is_refused_and_costs_nothing(run):
    running = run(tracker_factory=make_tracker)
    running.start(30, 30, 20, 20)
    running.send(_image(running.graph, 0))
    small = running.graph.image(80, shape=(60, 80), dtype=np.uint8)
    status = running.send(small)
    assert status.state == 'refused' and '(60, 80)' in status.message
    assert running.send(_image(running.graph, 1)).state == 'tracking'


@pytest.mark.parametrize('value, states', [
    (np.nan, ['refused']), (np.inf, ['refused']), (-np.inf, ['refused']), (3e38, ['refused']),
    # As a camera's shutter makes it.
    (0.0, ['lost', 'uncertain'])])
def test_frame_of_nonsense_temperatures_costs_nothing(run, value, states):
    running = run(tracker_factory=make_tracker)

    def image(number, replacement=None):
        message = running.graph.image(shape=SHAPE, dtype=np.float32)
        pixels = np.frombuffer(message.data, np.float32).reshape(SHAPE)
        pixels[:] = _scene(number) if replacement is None else replacement
        return message
    running.start(30, 30, 20, 20)
    for number in range(5):
        assert running.send(image(number)).state == 'tracking'
    boxes = len(running.boxes)
    status = running.send(image(5, value))
    assert status.state in states
    assert len(running.boxes) == boxes + (status.state == 'uncertain')
    status = running.send(image(5))
    assert (status.state, status.track_id) == ('tracking', 1)


@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_numbers_that_no_camera_measures_cost_nothing(run):
    """Everything that the node computes of a frame is asked for, drawings too."""
    running = run(tracker_factory=make_tracker, radiometric_scale=1.0)
    overlays = running.graph.listen(Image, 'lmsco_tracker/overlay')
    running.start(30, 30, 20, 20)
    for number in range(6):
        message = running.graph.image(shape=SHAPE, dtype=np.float32)
        pixels = np.frombuffer(message.data, np.float32).reshape(SHAPE)
        pixels[:] = _scene(number)
        if number > 2:
            pixels[::7, ::5], pixels[3::7, 2::5], pixels[:4] = 3e38, -3e38, 3e38
        status = running.send(message)
        assert status.state == 'tracking', status.message
        x, y, width, height = running.last_box
        assert x + width / 2 == pytest.approx(40.5 + 2 * number, abs=2)
        assert y + height / 2 == pytest.approx(40.5 + number, abs=2)
    running.graph.spin_until(lambda: len(overlays) == 6)
