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

"""Tracking with networks: motion beside appearance, the paper's preset, missing weights."""

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import save_file

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackState, WeightsError
from lmsco_ros.core.config import (
    ChannelConfig, FeatureConfig, LearningConfig, PresenceConfig, SamplingConfig, ScaleConfig,
    SearchConfig)
from lmsco_ros.core.features.motion import MotionObserver
from lmsco_ros.core.weights.store import DIRECTORY_VARIABLE

STILL = (FeatureConfig((ChannelConfig('hog'), ChannelConfig('intensity')), 4),)
MOVING = (*STILL, FeatureConfig((ChannelConfig('motion', layer='deep'),), 4, projection=6))
CONFIG = TrackerConfig(
    features=STILL, sampling=SamplingConfig(4.0, 108, 108),
    learning=LearningConfig(initial_iterations=10, iterations=2, update_interval=2))
SEARCH = ScaleConfig(step=1.03, exponent_min=-2, exponent_max=1)
START, SIZE = (60.3, 62.4), (30.0, 24.0)


@pytest.fixture
def seen_flow(monkeypatch):
    """Return a list that gets, for each look for motion, the flow images or None."""
    found, look = [], MotionObserver.images

    def spy(self, *arguments):
        found.append(look(self, *arguments))
        return found[-1]
    monkeypatch.setattr(MotionObserver, 'images', spy)
    return found


def follow(config, frames):
    """Return the results over the frames, the first of which shows the target at the start."""
    tracker = LMSCOTracker(config)
    return [tracker.update(frame) if n else
            tracker.initialize(frame, BoundingBox.from_center(START, SIZE))
            for n, frame in enumerate(frames)]


@pytest.mark.parametrize('learning', [
    {}, {'loss': 'coupled', 'initial_iterations': 20}], ids=['unit', 'coupled'])
@pytest.mark.parametrize('scale', [CONFIG.scale, SEARCH], ids=['one', 'search'])
def test_a_still_scene_is_tracked_as_well_with_the_motion_block(
        make_scene, rng, random_weights, seen_flow, learning, scale):
    clean = make_scene().render(START, SIZE)
    frames = [np.round(clean + 2 * rng.normal(size=clean.shape)).astype(np.uint16)
              for _ in range(6)]
    config = replace(CONFIG, scale=scale, learning=replace(CONFIG.learning, **learning))
    without = follow(config, frames)
    assert seen_flow == []
    with_motion = follow(replace(config, features=MOVING), frames)
    # Once in the first frame, and in each of the others.
    assert seen_flow == [None] * 6
    for one, other in zip(without, with_motion, strict=True):
        assert other.box.as_tuple() == pytest.approx(one.box.as_tuple(), abs=1e-4)
        assert other.score == pytest.approx(one.score, abs=1e-5) and other.state == one.state
        np.testing.assert_allclose(other.confidence_map, one.confidence_map, atol=1e-4)


def moving_scene(scene, count, pan=1.3):
    """Return frames and centers of a target that goes right while the ground goes left."""
    centers = [(START[0] + 1.9 * n, START[1] + 0.4 * n) for n in range(count)]
    return [scene.frame(center, SIZE, pan=(-pan * n, 0)) for n, center in enumerate(centers)
            ], centers


@pytest.mark.parametrize('scale', [CONFIG.scale, SEARCH], ids=['one', 'search'])
def test_a_moving_target_on_a_moving_ground_is_followed(
        make_scene, random_weights, seen_flow, scale):
    frames, centers = moving_scene(make_scene(clutter=60.0), 12)
    results = follow(replace(CONFIG, features=MOVING, scale=scale), frames)
    assert seen_flow[0] is None
    # The box is where it was scaled by 1, to the last bits or not: motion is seen in every frame.
    assert all(images is not None for images in seen_flow[1:])
    scales = 1 if scale is CONFIG.scale else 4
    assert {images.shape for images in seen_flow[1:]} == {(scales, 108, 108, 3)}
    for result, center in zip(results, centers, strict=True):
        assert result.box.center == pytest.approx(center, abs=1.5)
        assert result.state is TrackState.TRACKING
    assert not any(np.array_equal(one.confidence_map, other.confidence_map) for one, other in
                   zip(results[2:], follow(replace(CONFIG, scale=scale), frames)[2:],
                       strict=True))


def test_size_is_kept_where_the_target_is_found_again(make_scene):
    """Elsewhere the target is searched at one scale, which says nothing of its size."""
    config = replace(CONFIG, scale=SEARCH, search=SearchConfig(tiles=12), presence=PresenceConfig(
        reference_frames=5, uncertain=0.4, lost=0.2, lost_frames=3, found=0.3))
    scene, tracker = make_scene(), LMSCOTracker(config)
    tracker.initialize(scene.frame((45.3, 40.4)), BoundingBox.from_center((45.3, 40.4), (24, 18)))
    for n in range(1, 6):
        tracker.update(scene.frame((45.3 + n / 2, 40.4)))
    for n in range(4):
        gone = tracker.update(scene.frame(pan=(n / 10, 0)))
    assert gone.state is TrackState.LOST
    results = (tracker.update(scene.frame((121.6, 86.2), pan=(n / 10, 0))) for n in range(4, 12))
    back = next(result for result in results if result.state is not TrackState.LOST)
    assert back.box.center == pytest.approx((121.6, 86.2), abs=1.5)
    # By one step of the scale at most, which the second of the two frames that agree searches.
    assert back.box.width == pytest.approx(gone.box.width, rel=0.01)


@pytest.mark.parametrize('name', ['paper', 'mas', 'ma', 'a'])
def test_missing_weights_are_named_with_what_to_do(monkeypatch, tmp_path, name):
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path))
    with pytest.raises(WeightsError) as caught:
        LMSCOTracker(TrackerConfig.preset(name))
    message = str(caught.value)
    assert f'the weights vgg_m_2048 are not in {tmp_path}' in message
    for words in ('lmsco weights fetch vgg_m_2048', 'lmsco weights import FILE --as vgg_m_2048',
                  'the presets default and hcs need none'):
        assert words in message


def test_presets_that_need_no_weights_are_built_without_any(monkeypatch, tmp_path, make_scene):
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path))
    for name in ('default', 'hcs'):
        LMSCOTracker(TrackerConfig.preset(name))


def test_paper_runs_with_weights_from_the_folder(monkeypatch, tmp_path, make_scene, seen_flow):
    from lmsco_ros.core.weights.registry import find_source
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path))
    generator = np.random.default_rng(5)
    for name in ('vgg_m_2048', 'motion_cnn'):
        arrays = {}
        for array, shape in find_source(name).architecture.file_shapes().items():
            spread = (2 / np.prod(shape[1:]))**0.5 if len(shape) > 1 else 0.5
            arrays[array] = generator.normal(0, spread, shape).astype(np.float32)
        save_file(arrays, tmp_path / f'{name}.safetensors')
    config = TrackerConfig.from_dict({'preset': 'paper', 'learning': {'initial_iterations': 5}})
    frames, centers = moving_scene(make_scene(), 2)
    result = follow(config, frames)[-1]
    assert len(config.features) == 3 and seen_flow[-1].shape[0] == 10
    assert result.box.center == pytest.approx(centers[-1], abs=4)
    assert result.state is TrackState.TRACKING
