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

"""How well the tracker tracks, where the truth is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackState
from lmsco_ros.core.config import (
    ChannelConfig, ExtentConfig, FeatureConfig, IntensityConfig, LearningConfig, PresenceConfig,
    SamplingConfig, ScaleConfig, SearchConfig)

CONFIG = TrackerConfig(
    features=(FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity')), 4),),
    intensity=IntensityConfig(low_percentile=1, high_percentile=99, smoothing=0.2, jump=0.1),
    sampling=SamplingConfig(search_factor=5.0, patch_size_min=140, patch_size_max=140),
    learning=LearningConfig(
        margin_weight=1.0, label_sigma=1 / 12,
        window_minimum=0.03, window_edge=0.05, memory_size=30, learning_rate=0.01,
        initial_iterations=30, iterations=3, gradient_steps=2, update_interval=5),
    extent=ExtentConfig('extent'))
HANDCRAFTED = TrackerConfig.from_dict({
    'preset': 'hcs', 'sampling': {'patch_size_min': 140, 'patch_size_max': 140},
    'scale': {'exponent_min': 0, 'exponent_max': 0}, 'extent': {'network': 'extent'}})
SEARCH = replace(CONFIG, extent=ExtentConfig(), scale=ScaleConfig(
    step=1.01, exponent_min=-2, exponent_max=2))
SIZE = (24.0, 18.0)


def path(n):
    """Return the center of the target in frame n: more than a pixel a frame, never whole."""
    return 60.3 + 1.1 * n, 50.4 + 6 * np.sin(n / 6) + 0.41 * n


def follow(scene, config, count, growth=1.0, panning=False, convert=None):
    """
    Track a target over `count` frames.

    Returns
    -------
    ndarray, shape (count, 3)
        Errors of the center (x, y) in pixels and of the size, as a part of it.
    list of TrackResult
        Results.

    """
    tracker = LMSCOTracker(config)
    errors, results = [], []
    for n in range(count):
        scale, center = growth**n, path(n)
        pan = [c - scale * start for c, start in zip(center, path(0), strict=True)]
        camera = {'pan': pan, 'zoom': scale} if panning else {}
        size = (SIZE[0] * scale, SIZE[1] * scale)
        image = scene.frame(center, size, **camera)
        image = image if convert is None else convert(image)
        result = (tracker.update(image) if n
                  else tracker.initialize(image, BoundingBox.from_center(center, size)))
        results.append(result)
        errors.append((result.box.center[0] - center[0], result.box.center[1] - center[1],
                       result.box.width / size[0] - 1))
    return np.array(errors), results


def report(errors):
    """Return and print the errors of position and size."""
    position, size = np.abs(errors[:, :2]), np.abs(errors[:, 2])
    print(f'position: mean {position.mean():.3f} px, largest {position.max():.3f} px; '
          f'size: mean {size.mean():.4f}, largest {size.max():.4f}')
    return position, size


@pytest.mark.parametrize('panning', [False, True], ids=['moving_target', 'moving_camera'])
@pytest.mark.parametrize('growth', [1.0, 1.006, 0.994])
def test_position_and_size_are_recovered(make_scene, panning, growth):
    errors, results = follow(make_scene(), CONFIG, 21, growth, panning)
    position, size = report(errors)
    # What a convention of drawing may explain is not taken for a change.
    assert position.mean() < 0.15
    assert size.mean() < 0.08
    assert position.max() < 0.5 and size.max() < 0.1
    assert all(result.state is TrackState.TRACKING for result in results)


@pytest.mark.parametrize('panning, growth, bound', [
    (True, 1.006, 0.01), (True, 0.994, 0.01), (False, 1.006, 0.03)])
def test_search_over_scaled_patches_recovers_them(make_scene, panning, growth, bound):
    # Four fifths of a scaled patch are background: one that does not scale holds the size back.
    errors, _ = follow(make_scene(), SEARCH, 16, growth, panning)
    position, size = report(errors)
    assert position.mean() < 0.1
    assert size.mean() < bound


@pytest.mark.parametrize('name, convert', [
    ('uint16', lambda image: (5 * image + 777).astype(np.uint16)),
    ('uint16', lambda image: image - np.uint16(6000)),
    ('float32', lambda image: (0.01 * image.astype(np.float64) - 273.15).astype(np.float32)),
    ('float32', lambda image: (100 * image.astype(np.float64) + 5e4).astype(np.float32)),
], ids=['gain5', 'offset', 'celsius', 'gain100'])
def test_gain_and_offset_of_the_camera_change_nothing(make_scene, name, convert):
    plain, _ = follow(make_scene(), CONFIG, 8)
    other, results = follow(make_scene(), CONFIG, 8, convert=convert)
    # Stated tolerance: a fiftieth of a pixel, and a thousandth of the size.
    print(f'{name}: largest difference {np.abs(other - plain).max(axis=0)}')
    assert np.abs(other - plain)[:, :2].max() < 0.02
    assert np.abs(other - plain)[:, 2].max() < 0.001


@pytest.mark.parametrize('config', [CONFIG, replace(
    SEARCH, scale=ScaleConfig(step=1.02, exponent_min=-1, exponent_max=2))],
    ids=['extent', 'search'])
def test_size_of_a_static_target_does_not_drift(make_scene, rng, config):
    small = replace(config, sampling=SamplingConfig(4.0, 60, 60))
    scene, tracker = make_scene(), LMSCOTracker(small)
    truth = BoundingBox.from_center((80.3, 60.4), SIZE)
    clean = scene.render(truth.center, SIZE)
    for n in range(101):
        noisy = np.round(clean + 4 * rng.normal(size=clean.shape)).astype(np.uint16)
        result = tracker.update(noisy) if n else tracker.initialize(noisy, truth)
    assert result.box.width == pytest.approx(truth.width, rel=0.05)
    assert result.box.center == pytest.approx(truth.center, abs=0.5)


def test_size_stays_where_nothing_measures_it(make_scene):
    config = replace(CONFIG, extent=ExtentConfig())
    _, results = follow(make_scene(), config, 6, 1.006)
    assert all(result.box.size == pytest.approx(SIZE) for result in results)


@pytest.mark.parametrize('elsewhere', [(101.3, 64.6), (121.6, 86.2)])
def test_target_is_lost_and_found_again_elsewhere(make_scene, elsewhere):
    config = replace(CONFIG, search=SearchConfig(tiles=6), presence=PresenceConfig(
        reference_frames=5, uncertain=0.4, lost=0.2, lost_frames=3, found=0.3))
    scene, tracker = make_scene(), LMSCOTracker(config)
    start = (45.3, 40.4)
    tracker.initialize(scene.frame(start), BoundingBox.from_center(start, SIZE))
    for n in range(1, 7):
        result = tracker.update(scene.frame((start[0] + n / 2, start[1])))
        assert result.state is TrackState.TRACKING
    trusted = result.box
    states = []
    for n in range(5):
        gone = tracker.update(scene.frame(pan=(n / 10, 0)))
        states.append(gone.state)
    assert TrackState.TRACKING not in states[1:]
    assert states[-1] is TrackState.LOST
    assert gone.box.overlap(trusted) > 0.5
    assert gone.score < 0.5 * result.score + 0.25
    for n in range(12):
        back = tracker.update(scene.frame(elsewhere, pan=(n / 10, 0)))
    assert back.state is TrackState.TRACKING
    assert back.box.center == pytest.approx(elsewhere, abs=1.0)


def real_frames(folder, count):
    """Return the first frames of a sequence, as stored."""
    videos = sorted([*folder.glob('*.mp4'), *folder.glob('*.avi')])
    if videos:
        capture = cv2.VideoCapture(str(videos[0]))
        frames = [capture.read()[1] for _ in range(count)]
        capture.release()
        return frames
    files = sorted(p for p in folder.rglob('*') if p.suffix.lower() in ('.png', '.jpg', '.jpeg'))
    return [cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in files[:count]]


def real_boxes(folder, count):
    """Return the true boxes: x, y, w, h or the corners of a polygon."""
    text = (folder / 'groundtruth.txt').read_text().replace('\t', ',').split()
    rows = [np.array(row.split(','), float) for row in text[:count]]
    return [BoundingBox(*row) if len(row) == 4 else BoundingBox(
        row[::2].min(), row[1::2].min(), np.ptp(row[::2]), np.ptp(row[1::2])) for row in rows]


@pytest.mark.parametrize('name, bound', [
    ('vot_tir/crowd', 0.5), ('ptb_tir/airplane', 0.5), ('drone_ir/airplane_001', 0.4)])
def test_real_sequences(test_data, name, bound):
    folder = test_data / 'thermal_dev' / name
    if not folder.is_dir():
        pytest.skip(f'no sequence {folder}')
    count = 60
    frames, boxes = real_frames(folder, count), real_boxes(folder, count)
    tracker = LMSCOTracker(HANDCRAFTED)
    overlaps = [tracker.initialize(frames[0], boxes[0]).box.overlap(boxes[0])]
    overlaps += [tracker.update(frame).box.overlap(box)
                 for frame, box in zip(frames[1:], boxes[1:], strict=True)]
    print(f'{name}: mean overlap {np.mean(overlaps):.3f}, smallest {min(overlaps):.3f}')
    assert np.mean(overlaps) > bound
