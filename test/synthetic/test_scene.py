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

"""The scene keeps the promises of its plot, and its truth is exact."""

from dataclasses import replace

import numpy as np
import pytest

from lmsco_ros.synthetic import render_scene, SceneConfig

SMALL = SceneConfig(width=160, height=128, frames=90)
QUIET = replace(SMALL, noise=0, pattern=0)


@pytest.fixture(scope='module')
def story():
    return list(render_scene(SMALL))


@pytest.fixture(scope='module')
def quiet_story():
    return list(render_scene(QUIET))


def inside(frame):
    box = frame.box
    return np.s_[max(0, round(box.y)):round(box.y + box.height),
                 max(0, round(box.x)):round(box.x + box.width)]


def test_frames_are_raw_counts_with_stamps(story):
    assert [f.index for f in story] == list(range(90))
    assert all(f.image.shape == (128, 160) and f.image.dtype == np.uint16 for f in story)
    assert np.diff([f.stamp_ns for f in story]) == pytest.approx(1e9 / 30, abs=1)
    assert 6500 < story[0].image.min() and story[0].image.max() < 8500


def test_same_config_same_frames():
    config = replace(SMALL, frames=3)
    first, second = list(render_scene(config)), list(render_scene(config))
    for one, other in zip(first, second):
        np.testing.assert_array_equal(one.image, other.image)
        assert (one.box, one.visible) == (other.box, other.visible)


def test_another_seed_another_scene():
    config = replace(SMALL, frames=1)
    first, = render_scene(config)
    second, = render_scene(replace(config, seed=2))
    assert (first.image != second.image).mean() > 0.5


def test_target_stays_in_sight_moves_and_changes_size(story):
    heights = [f.box.height for f in story]
    assert max(heights) / min(heights) > 1.6
    centers = np.array([f.box.center for f in story])
    assert np.all((centers > 0) & (centers < (160, 128)))
    assert np.ptp(centers[:, 0]) > 40


def test_target_is_warmer_than_its_surroundings(quiet_story):
    for frame in quiet_story[::10]:
        if frame.visible > 0.95:
            assert frame.image[inside(frame)].max() > np.median(frame.image) + 200


def test_target_is_hidden_once_and_comes_back(story):
    hidden = np.array([f.visible for f in story]) < 0.9
    assert 2 <= hidden.sum() <= 20
    first, last = np.flatnonzero(hidden)[[0, -1]]
    assert hidden[first:last + 1].all()
    assert 0.1 < min(f.visible for f in story) < 0.6
    assert story[-1].visible == pytest.approx(1, abs=1e-3)


def test_box_follows_the_warm_body(quiet_story):
    frames = [f for f in quiet_story if f.visible > 0.99]
    for frame in frames[:20]:
        warm = np.zeros_like(frame.image, dtype=bool)
        warm[inside(frame)] = frame.image[inside(frame)] > 7840
        columns = np.flatnonzero(warm.any(0))
        assert columns.mean() == pytest.approx(frame.box.center[0] - 0.5, abs=1.5)


def test_camera_pans(quiet_story):
    def skyline_columns(frame):
        return frame.image[:45].astype(float).argmax(0)

    first, last = skyline_columns(quiet_story[0]), skyline_columns(quiet_story[45])
    assert (first != last).mean() > 0.2


def test_noise_is_as_strong_as_asked(quiet_story):
    noisy = list(render_scene(replace(SMALL, noise=8.0, pattern=0, frames=90)))
    for loud, quiet in zip(noisy[:5], quiet_story):
        still = loud.image[:30].astype(float) - quiet.image[:30]
        assert still.std() == pytest.approx(8, rel=0.15)


def test_pattern_stays_while_noise_changes():
    config = replace(SMALL, noise=0, pattern=6, frames=2)
    plain = list(render_scene(replace(config, pattern=0)))
    first, second = (one.image.astype(float) - other.image
                     for one, other in zip(render_scene(config), plain))
    assert first.std() == pytest.approx(6, rel=0.2)
    assert np.abs(first - second).max() <= 1


@pytest.mark.parametrize('wrong', [
    {'width': 8}, {'frames': 0}, {'fps': 0.0}, {'target_height': 3.0}])
def test_impossible_scenes_are_refused(wrong):
    with pytest.raises(ValueError, match='give'):
        replace(SMALL, **wrong)
