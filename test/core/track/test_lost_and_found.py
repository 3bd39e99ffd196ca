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

"""What is said while the target is away, beside another one, or after a closed shutter."""

from itertools import islice

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox, LMSCOTracker, TrackerConfig, TrackState
from lmsco_ros.core.search.redetection import Redetection
from lmsco_ros.synthetic import render_story, SceneConfig

CONFIG = TrackerConfig.from_dict({
    'features': [{'channels': [{'kind': 'hog'}, {'kind': 'intensity'}], 'cell': 4}],
    'sampling': {'patch_size_min': 100, 'patch_size_max': 100},
    'extent': {'network': ''}})
SIZE = (24.0, 18.0)
START = (60.3, 64.4)


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene((240, 160))


def started(scene, frame, config=CONFIG, count=6):
    """Return a tracker that has followed a target at rest over some frames."""
    tracker = LMSCOTracker(config)
    tracker.initialize(frame(0), BoundingBox.from_center(START, SIZE))
    for n in range(1, count):
        assert tracker.update(frame(n)).state is TrackState.TRACKING
    return tracker


def resting(scene, center=START):
    """Return frames of a target at rest before ground that moves a little."""
    return lambda n: scene.frame(center, SIZE, pan=(n / 10, 0))


def with_twin(scene, frame, offset=(50, 20)):
    """Return frames with a second target beside the first one."""
    alone, empty = scene.render(START, SIZE), scene.render()
    difference = np.roll(alone - empty, offset[::-1], axis=(0, 1))
    return lambda n: np.round(frame(n) + difference).astype(np.uint16)


def test_twin_that_remains_is_not_taken_for_the_target(scene):
    frame, gone = (with_twin(scene, part) for part in (resting(scene), resting(scene, None)))
    tracker = started(scene, frame)
    results = [tracker.update(gone(n)) for n in range(6, 26)]
    assert TrackState.TRACKING not in {result.state for result in results}
    assert results[-1].state is TrackState.LOST
    back = [tracker.update(frame(n)) for n in range(26, 35)][-1]
    assert back.state is TrackState.TRACKING
    assert back.box.center == pytest.approx(START, abs=1.0)


def test_target_that_jumps_where_nothing_was_is_followed(scene):
    elsewhere = (START[0] + 50, START[1] + 20)
    tracker = started(scene, resting(scene))
    results = [tracker.update(resting(scene, elsewhere)(n)) for n in range(6, 15)]
    assert results[-1].state is TrackState.TRACKING
    assert results[-1].box.center == pytest.approx(elsewhere, abs=1.0)


def test_place_of_a_hidden_target_is_carried_by_the_camera(scene, monkeypatch):
    """The camera pans from the third frame on in which the target is hidden."""
    search, searched = Redetection.__call__, []

    def watched(self, outlook, here, **how):
        searched.append(outlook.last.center)
        return search(self, outlook, here, **how)

    monkeypatch.setattr(Redetection, '__call__', watched)
    tracker = started(scene, resting(scene), count=12)
    ways = np.maximum(0.0, 1.2 * (np.arange(35) - 2))
    for way in ways:
        result = tracker.update(scene.frame(pan=(1.2 + way, way / 4)))
    there = (START[0] + ways[-1], START[1] + ways[-1] / 4)
    assert result.state is TrackState.LOST
    assert result.predicted_box.center == pytest.approx(there, abs=4.0)
    assert searched[-1] == pytest.approx(there, abs=4.0)
    assert result.box.center == pytest.approx(START, abs=1.0)
    found = [tracker.update(scene.frame(there, SIZE, pan=(1.2 + ways[-1] + n / 10, ways[-1] / 4)))
             for n in range(8)][-1]
    assert found.state is TrackState.TRACKING
    assert found.box.center == pytest.approx(there, abs=1.0)


def test_target_of_another_view_is_found_soon(scene, make_scene):
    other, elsewhere = make_scene((240, 160), 5), (START[0] + 110, START[1] + 40)
    tracker = started(scene, resting(scene))
    results = [tracker.update(resting(other, elsewhere)(n)) for n in range(6, 16)]
    # All speaks for the new place, so that one frame is enough; but nothing is learned yet.
    assert results[0].state is TrackState.UNCERTAIN
    assert results[0].box.center == pytest.approx(elsewhere, abs=1.5)
    assert results[-1].state is TrackState.TRACKING
    assert results[-1].box.center == pytest.approx(elsewhere, abs=1.5)


def test_view_without_the_target_ends_in_lost(scene, make_scene):
    other = make_scene((240, 160), 5)
    tracker = started(scene, resting(scene))
    results = [tracker.update(resting(other, None)(n)) for n in range(6, 16)]
    assert results[-1].state is TrackState.LOST


def test_target_leaves_the_image_and_comes_back(scene):
    tracker = started(scene, resting(scene))
    x = [START[0] - 5 * n for n in range(1, 26)]
    away = [tracker.update(scene.frame((left, START[1]), SIZE, pan=(left / 50, 0))) for left in x]
    for result in away:
        assert result.box.x >= 0 and result.box.x + result.box.width <= 240
    assert away[-1].state is TrackState.LOST
    back = [tracker.update(scene.frame((left, START[1]), SIZE, pan=(left / 50 + 0.01, 0)))
            for left in x[::-1]]
    assert back[-1].state is TrackState.TRACKING
    assert back[-1].box.center == pytest.approx((x[0], START[1]), abs=1.5)


@pytest.mark.parametrize('speed', [0.7, 1.5])
def test_walker_who_vanishes_slowly_behind_a_wall_is_found_in_the_old_size(walker_images, speed):
    places = [(40 + speed * n, 79) for n in range(round(180 / speed))]
    images = walker_images(places, wall=(110, 60, 155, 130))
    tracker, states = LMSCOTracker(), []
    tracker.initialize(next(images), BoundingBox(40, 79, 18, 41))
    for image in images:
        result = tracker.update(image)
        states.append(result.state)
    assert TrackState.LOST in states and states[-1] is TrackState.TRACKING
    assert result.box.overlap(BoundingBox(*places[-1], 18, 41)) > 0.7


@pytest.mark.parametrize('seed', [3, 6])
def test_walker_whom_a_truck_hides_is_lost_though_something_is_seen_there(seed):
    scene = SceneConfig(width=320, height=256, frames=300, fps=10.0, seed=seed)
    first, *rest = islice(render_story(scene), 110, 240)
    tracker = LMSCOTracker()
    tracker.initialize(first.image, first.box)
    told = [tracker.update(frame.image) for frame in rest]
    hidden = [result.state for frame, result in zip(rest, told) if frame.visible < 0.1]
    assert hidden.count(TrackState.LOST) > len(hidden) / 2 and TrackState.TRACKING not in hidden
    assert told[-1].state is TrackState.TRACKING
    assert told[-1].box.overlap(rest[-1].box) > 0.6


def test_target_that_got_away_behind_the_shutter_is_found_with_the_second_frame(scene):
    frame = resting(scene)
    tracker = started(scene, frame)
    for _ in range(10):
        assert tracker.update(frame(5)).state is TrackState.TRACKING
    elsewhere = (START[0] + 70, START[1] + 25)
    tracker.update(resting(scene, elsewhere)(6))
    result = tracker.update(resting(scene, elsewhere)(7))
    assert result.state is not TrackState.LOST
    assert result.box.center == pytest.approx(elsewhere, abs=1.5)


def noise(seed, shape=(160, 240)):
    """Return white noise."""
    return np.random.default_rng(seed).normal(7600, 150, shape).astype(np.uint16)


@pytest.mark.parametrize('run', range(4))
def test_pattern_that_does_not_repeat_is_told_and_lost(run):
    tracker = LMSCOTracker()
    result = tracker.initialize(noise((run, 0)), BoundingBox.from_center(START, SIZE))
    assert result.note == 'start: nothing stands out' and result.score < 0.5
    results = [tracker.update(noise((run, n))) for n in range(1, 31)]
    assert TrackState.TRACKING not in {result.state for result in results}
    assert results[-1].state is TrackState.LOST


def test_ground_that_stands_out_by_nothing_is_told(scene):
    tracker, frame = LMSCOTracker(), resting(scene, None)
    results = [tracker.initialize(frame(0), BoundingBox.from_center((150.3, 90.2), SIZE))]
    results += [tracker.update(frame(n)) for n in range(1, 20)]
    assert {result.note for result in results} == {'start: nothing stands out'}
    assert max(result.score for result in results) < 0.5


def test_still_target_that_stands_out_stays_tracked(scene):
    tracker, image = LMSCOTracker(), scene.frame(START, SIZE)
    rng = np.random.default_rng(5)
    results = [tracker.initialize(image, BoundingBox.from_center(START, SIZE))]
    results += [tracker.update(image + rng.integers(0, 3, image.shape).astype(np.uint16))
                for _ in range(40)]
    assert {result.state for result in results} == {TrackState.TRACKING}
    assert {result.note for result in results} == {''}


def test_target_in_sudden_noise_is_not_lost(scene):
    """The sharpness falls for good, as the noise lets expect, and nothing else does."""
    tracker, rng = LMSCOTracker(), np.random.default_rng(6)
    frame = resting(scene)
    tracker.initialize(frame(0), BoundingBox.from_center(START, SIZE))
    for n in range(1, 40):
        image = frame(n).astype(float)
        if n >= 12:
            middle = np.median(image)
            image = middle + 0.5 * (image - middle) + 60 * rng.normal(size=image.shape)
        result = tracker.update(image.astype(np.uint16))
        assert result.state is not TrackState.LOST
    assert result.box.center == pytest.approx(START, abs=3)


def test_paper_follows_every_frame(scene):
    config = TrackerConfig.from_dict({
        **CONFIG.to_dict(), 'presence': TrackerConfig.preset('paper').to_dict()['presence']})
    tracker = started(scene, resting(scene), config)
    boxes = [tracker.update(resting(scene, None)(n)).box for n in range(6, 12)]
    assert len(set(boxes)) == len(boxes)
