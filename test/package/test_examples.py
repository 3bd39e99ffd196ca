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

"""Every example runs on generated data, stands on the page of examples, and says what it needs."""

import ast
import importlib.util
import itertools
from pathlib import Path
import time

import cv2
import numpy as np
import pytest

from lmsco_ros.synthetic.scene import render_scene, SceneConfig

REPOSITORY = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((REPOSITORY / 'examples').glob('*.py'))
PAGE = REPOSITORY / 'docs' / 'examples.md'
LINES = 106
PATIENCE_SECONDS = 60.0


def load(name):
    """Import an example, which belongs to no package."""
    spec = importlib.util.spec_from_file_location(name, REPOSITORY / 'examples' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='module')
def scene():
    """Render a few frames of a walker, with the truth."""
    return list(render_scene(SceneConfig(width=192, height=160, frames=120)))[:5]


def text_of(box):
    """Return a box as the command lines of the examples take it."""
    return ','.join(f'{number:.2f}' for number in box.as_tuple())


def write_images(scene, folder):
    """Write the frames as 16-bit png."""
    folder.mkdir(parents=True)
    for frame in scene:
        cv2.imwrite(str(folder / f'{frame.index:04d}.png'), frame.image)


@pytest.fixture
def film(scene, tmp_path):
    """Write the frames as an 8-bit film."""
    path = tmp_path / 'film.avi'
    height, width = scene[0].image.shape
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*'MJPG'), 30, (width, height))
    low = min(frame.image.min() for frame in scene)
    for frame in scene:
        view = np.clip((frame.image - low) / 3, 0, 255).astype(np.uint8)
        writer.write(cv2.cvtColor(view, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


@pytest.fixture
def window(monkeypatch):
    """Stand in for the windows, which the tests have no screen for; return what is shown."""
    shown = []
    monkeypatch.setattr(cv2, 'imshow', lambda name, image: shown.append(image))
    monkeypatch.setattr(cv2, 'waitKey', lambda delay: -1)
    monkeypatch.setattr(cv2, 'destroyAllWindows', lambda: None)
    return shown


def test_live_loop_shows_every_frame_with_the_box(scene, film, window):
    load('live_opencv').main([str(film), '--box', text_of(scene[0].box)])
    assert len(window) == len(scene) - 1
    # A gray film has no color but that of the overlay.
    assert all((image.max(axis=2) > image.min(axis=2)).any() for image in window)


def test_live_loop_asks_for_a_box_and_ends_by_a_key(scene, film, window, monkeypatch):
    monkeypatch.setattr(cv2, 'selectROI', lambda name, image: tuple(
        int(number) for number in scene[0].box.as_tuple()))
    monkeypatch.setattr(cv2, 'waitKey', lambda delay: ord('q'))
    load('live_opencv').main([str(film)])
    assert len(window) == 1


def test_live_loop_says_that_nothing_comes(tmp_path):
    with pytest.raises(SystemExit, match='gives no image'):
        load('live_opencv').main([str(tmp_path / 'none.avi')])


def test_two_targets_are_told_side_by_side(scene, tmp_path, capsys):
    write_images(scene, tmp_path / 'frames')
    box, second = scene[0].box, scene[0].box.moved_to((150.0, 130.0))
    load('two_targets').main([str(tmp_path / 'frames'), text_of(box), text_of(second)])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(scene)
    assert lines[0].startswith(f'0000.png ({box.x:.1f}, ')
    assert all(line.count('(') + line.count('lost') == 2 for line in lines)


def test_temperatures_are_told_and_pixels_without_one_left_out(tmp_path, capsys):
    celsius = np.random.default_rng(0).normal(20.0, 0.1, (3, 96, 128)).astype(np.float32)
    celsius[:, 30:60, 40:60] += 17.0
    celsius[:, 45, 50] = np.nan
    np.save(tmp_path / 'recording.npy', celsius)
    load('celsius_frames').main([str(tmp_path / 'recording.npy'), '--box', '40,30,19.5,29.5'])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith('0: x 40.0 y 30.0, mean 37.0 C')
    assert all('tracking' in line for line in lines)


def test_own_sequences_are_evaluated_with_both_configurations(scene, tmp_path, capsys):
    write_images(scene, tmp_path / 'sequences' / 'walk' / 'ir')
    (tmp_path / 'sequences' / 'walk' / 'groundtruth.txt').write_text(
        '\n'.join(text_of(frame.box) for frame in scene))
    (tmp_path / 'fixed.yaml').write_text("extent: {network: ''}")
    load('own_sequences').main([str(tmp_path / 'sequences'),
                                '--config', str(tmp_path / 'fixed.yaml')])
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[:2] for line in lines] == [['walk:', 'default'], ['walk:', 'fixed']]
    assert all(0.5 < float(line[2]) <= 1 for line in lines)


def test_subscriber_tells_what_the_tracker_publishes():
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')
    from std_msgs.msg import Header

    from msg_adapters.boxes import polygon_from_box
    from msg_adapters.status import FrameStatus, message_from_status
    told = []
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        listener = load('ros_subscriber').TargetListener(told.append, context=context)
        topics = {subscription.topic_name for subscription in listener.subscriptions}
        assert {'/lmsco_tracker/box', '/lmsco_tracker/status'} <= topics
        listener._on_box(polygon_from_box((10, 20, 30, 40), Header()))
        for score in (0.75, None):
            listener._on_status(message_from_status(
                FrameStatus('tracking' if score else 'idle', 1, score, 5.0, 4.0, 0), 'tracker'))
        listener.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    assert told == ['0.000000000: 30 x 40 at (10.0, 20.0)', 'tracking, score 0.75', 'idle']


@pytest.fixture
def spinning():
    """Return a context, and a function that spins nodes in it until a condition holds."""
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')
    context = rclpy.Context()
    rclpy.init(context=context)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)

    def spin_until(condition, *nodes):
        deadline = time.monotonic() + PATIENCE_SECONDS
        for node in nodes:
            executor.add_node(node)
        while not condition():
            assert time.monotonic() < deadline, 'nothing happened in time'
            executor.spin_once(timeout_sec=0.02)
    yield context, spin_until
    for node in executor.get_nodes():
        node.destroy_node()
    executor.shutdown()
    rclpy.shutdown(context=context)


def test_head_is_steered_onto_the_target(spinning):
    """The loop is closed over the real node: rendered view, bearing, head, next view."""
    context, spin_until = spinning
    from geometry_msgs.msg import PoseWithCovarianceStamped

    from lmsco_ros.node.tracker_node import TrackerNode
    head = load('ros_pan_tilt').PanTiltHead((150.0, 160.0), context=context)
    tracker, bearings = TrackerNode(context=context), []
    topic = '/lmsco_tracker/bearing'
    head.create_subscription(PoseWithCovarianceStamped, topic, bearings.append, 10)
    spin_until(lambda: head.is_watched() and head.count_publishers(topic) and all(
        publisher.get_subscription_count() == 2 for publisher in tracker.publishers
        if publisher.topic_name == topic), head, tracker)
    off = []
    for frame in itertools.islice(render_scene(SceneConfig(width=480, height=320)), 90):
        told = len(bearings)
        off.append(head.step(frame))
        spin_until(lambda: len(bearings) > told)
    assert off[0] > 7 and max(off[45:]) < 1 and np.mean(off[60:]) < 0.5


def test_filter_looks_ahead_of_what_it_is_told(spinning):
    context, _ = spinning
    from std_msgs.msg import Header

    from msg_adapters.state import odometry_from_state, State
    told, rng = [], np.random.default_rng(0)
    node = load('ros_kalman').LookAhead(told.append, context=context)
    errors = []
    for number in range(60):
        time, header = number / 30, Header()
        header.stamp.nanosec, header.stamp.sec = number % 30 * 33_333_333, number // 30
        center = (100 + 40 * time + rng.normal(0, 2), 80 - 20 * time + rng.normal(0, 2))
        node._on_state(odometry_from_state(State(
            3, center, 4 * np.eye(2), (40.0, -20.0), 9 * np.eye(2)), header))
        (x, y, _, _), covariance = node.filters[3].ahead(0.2)
        errors.append((x - 100 - 40 * (time + 0.2), y - 80 + 20 * (time + 0.2)))
        assert np.linalg.eigvalsh(covariance).min() > 0
    assert np.std(errors[20:]) < 1.5 and told[-1].startswith('target 3 in 0.2 s: (18')
    node.destroy_node()


@pytest.mark.parametrize('example', EXAMPLES, ids=lambda path: path.stem)
def test_example_is_small_and_says_what_it_needs(example):
    text = example.read_text()
    assert f'python examples/{example.name}' in text
    assert '\nNeeds ' in ast.get_docstring(ast.parse(text))
    assert len(text.splitlines()) <= LINES


def test_page_shows_every_example_and_no_other():
    shown = PAGE.read_text().split('```{literalinclude} ../examples/')[1:]
    assert sorted(part.split('\n')[0] for part in shown) == [path.name for path in EXAMPLES]
