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

"""The story has its twin, its loss and its return, and its truth is exact."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lmsco_ros.synthetic import render_story, SceneConfig

SMALL = SceneConfig(width=160, height=128, frames=120, noise=0, pattern=0, clutter=0)
# Only heads are so warm where nothing else stands around.
HEAD = 7830


@pytest.fixture(scope='module')
def story():
    return list(render_story(SMALL))


def heads(frame):
    """Return the columns of the heads in sight."""
    count, _, _, middles = cv2.connectedComponentsWithStats((frame.image > HEAD).astype(np.uint8))
    return sorted(middles[1:count, 0])


def runs(flags):
    """Return how many runs of true there are."""
    return int(np.diff(np.r_[0, np.asarray(flags, int)]).clip(0).sum())


def test_target_is_hidden_once_for_seconds_and_comes_back(story):
    visible = np.array([frame.visible for frame in story])
    assert runs(visible < 0.05) == 1
    # Of 30 seconds, some three.
    assert 0.07 < (visible < 0.05).mean() < 0.17
    assert (visible[:50] > 0.95).all() and (visible[90:] > 0.95).all()


def test_hidden_target_is_covered_by_something_colder(story):
    frame = min(story, key=lambda frame: frame.visible)
    box = frame.box
    covered = frame.image[round(box.y):round(box.y + box.height),
                          round(box.x):round(box.x + box.width)]
    assert np.median(covered) < np.median(story[0].image[64:]) - 100


def test_twin_passes_close_by_and_leaves(story):
    apart = [abs(frame.box.center[0] - column) for frame in story[:60] for column in heads(frame)
             if len(heads(frame)) == 2 and abs(frame.box.center[0] - column) > 2]
    assert min(apart) < 8 < 40 < max(apart)
    assert len(heads(story[20])) == 2 and len(heads(story[-5])) == 1


def test_box_is_around_the_head_that_is_followed(story):
    for frame in (frame for frame in story if frame.visible > 0.99):
        nearest = min(heads(frame), key=lambda column: abs(column + 0.5 - frame.box.center[0]))
        assert nearest + 0.5 == pytest.approx(frame.box.center[0], abs=2)


def test_target_stays_in_the_picture_and_changes_size(story):
    centers = np.array([frame.box.center for frame in story])
    assert ((centers > 0) & (centers < (160, 128))).all()
    heights = [frame.box.height for frame in story]
    assert max(heights) / min(heights) > 1.3


def test_plot_is_stretched_over_any_length(story):
    short = list(render_story(replace(SMALL, frames=30)))
    hidden = [np.mean([frame.visible < 0.5 for frame in frames]) for frames in (story, short)]
    assert hidden[0] == pytest.approx(hidden[1], abs=0.05)


def test_same_config_same_frames():
    config = SceneConfig(width=64, height=64, frames=3)
    for one, other in zip(render_story(config), render_story(config), strict=True):
        np.testing.assert_array_equal(one.image, other.image)
        assert (one.box, one.visible) == (other.box, other.visible)
