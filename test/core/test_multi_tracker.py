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

"""Several targets: each as with a tracker of its own, and each with its own number."""

import copy
from dataclasses import replace
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from lmsco_ros.core import (
    BoundingBox, BoxError, BusyError, ImageError, LMSCOTracker, MultiTracker, TimeError,
    TrackState, UnknownTargetError)
from lmsco_ros.core import targets as targets_module
from lmsco_ros.core.detection.detector import Detector

SIZE = (24.0, 18.0)


@pytest.fixture(scope='module')
def scene(make_scene):
    return make_scene((240, 160))


def box_of(center):
    """Return the box of a target."""
    return BoundingBox.from_center(center, SIZE)


def frame(scene, *centers):
    """Return the frame with targets at all of these places; they are warmer than the rest."""
    counts = np.max([scene.render(center) for center in centers], axis=0)
    return np.round(counts).astype(np.uint16)


def assert_close(result, other):
    """Check that two results say the same."""
    assert result.state is other.state
    np.testing.assert_allclose(result.box.as_tuple(), other.box.as_tuple(), atol=1e-4)
    assert result.score == pytest.approx(other.score, abs=1e-4)
    np.testing.assert_allclose(result.confidence_map, other.confidence_map, atol=1e-4)
    assert result.search_region.as_tuple() == pytest.approx(other.search_region.as_tuple(),
                                                            abs=1e-4)
    assert result.velocity == pytest.approx(other.velocity, abs=1e-4)
    np.testing.assert_allclose(result.covariance, other.covariance, atol=1e-4)


def paths(number):
    """Return where three targets are in a frame."""
    return [(40 + number, 40), (200 - 0.5 * number, 50 + number), (60, 120 - 0.5 * number)]


def test_every_target_is_followed_as_by_a_tracker_of_its_own(scene):
    """One starts later, the polarity switches, the range drifts, the shutter closes."""
    several, alone = MultiTracker(), {}
    for number in range(24):
        image = frame(scene, *paths(number - (number == 9))) + np.uint16(2 * number)
        image = 14000 - image if number > 12 else image
        taken = 5 + number / 25
        before = several.update(image, taken)
        assert set(before) == set(alone)
        for target, tracker in alone.items():
            assert_close(before[target], tracker.update(image, taken))
        for center in {0: paths(0)[:2], 7: paths(7)[2:]}.get(number, ()):
            target, tracker = several.initialize(image, box_of(center), taken), LMSCOTracker()
            assert_close(several.results[target], tracker.initialize(image, box_of(center), taken))
            alone[target] = tracker
    assert several.ids == tuple(several.results) == (1, 2, 3)
    assert all(result.state is TrackState.TRACKING for result in several.results.values())


def test_lost_target_leaves_the_others_as_they_are(scene):
    several, alone = MultiTracker(), [LMSCOTracker(), LMSCOTracker()]
    for number in range(30):
        seen = paths(number)[:2] if number < 5 else paths(number)[:1]
        image = frame(scene, *seen)
        if number == 0:
            for tracker, center in zip(alone, seen):
                several.initialize(image, box_of(center))
                tracker.initialize(image, box_of(center))
            continue
        results = several.update(image)
        own = [tracker.update(image) for tracker in alone]
        assert_close(results[1], own[0])
        assert results[2].state is own[1].state
    assert results[2].state is TrackState.LOST


def test_numbers_grow_and_are_never_used_again(scene):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    assert tracker.ids == () and tracker.results == {}
    assert [tracker.initialize(image, box_of(center)) for center in paths(0)] == [1, 2, 3]
    tracker.drop(2)
    assert tracker.ids == (1, 3) and set(tracker.update(image)) == {1, 3}
    assert tracker.initialize(image, box_of(paths(0)[1])) == 4
    tracker.reset()
    assert tracker.ids == () and tracker.update(image) == {}
    assert tracker.initialize(image, box_of(paths(0)[0])) == 5


def test_target_takes_the_place_of_others(scene):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    first, second, _ = (tracker.initialize(image, box_of(center)) for center in paths(0))
    assert tracker.initialize(image, box_of(paths(0)[0]), in_place_of=(first, second)) == 4
    assert tracker.ids == (3, 4)


@pytest.mark.parametrize('box, error', [
    ((0, 0, 0, 5), BoxError), ((500, 500, 20, 20), BoxError), ('here', BoxError)])
def test_refused_start_changes_nothing(scene, box, error):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    tracker.initialize(image, box_of(paths(0)[0]))
    before = tracker.results
    with pytest.raises(error):
        tracker.initialize(image, box, in_place_of=(1,))
    assert tracker.results == before
    # The refused one has no number.
    assert tracker.initialize(image, box_of(paths(0)[1])) == 2


def test_frames_of_another_kind_are_refused_where_targets_stay(scene):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    tracker.initialize(image, box_of(paths(0)[0]))
    small = image[:120]
    with pytest.raises(ImageError, match='initialized in .160, 240. uint16; initialize again'):
        tracker.update(small)
    with pytest.raises(ImageError, match='the frame is .120, 240. uint16'):
        tracker.initialize(small, box_of(paths(0)[1]))
    assert tracker.ids == (1,)
    # Nobody stays: whatever comes may be the first frame.
    assert tracker.initialize(small, box_of(paths(0)[1]), in_place_of=(1,)) == 2
    assert set(tracker.update(small)) == {2}


@pytest.mark.parametrize('wrong', [None, float('nan'), 'noon'])
def test_time_that_does_not_fit_changes_nothing(scene, wrong):
    """No target has gone a step ahead of the others."""
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    for center in paths(0):
        tracker.initialize(image, box_of(center), 1.0)
    other, later = copy.deepcopy(tracker), frame(scene, *paths(1))
    with pytest.raises(TimeError):
        tracker.update(later, wrong)
    with pytest.raises(TimeError):
        tracker.initialize(image, box_of(paths(0)[0]), wrong)
    assert tracker.ids == (1, 2, 3)
    for one, two in zip(tracker.update(later, 2.0).values(), other.update(later, 2.0).values(),
                        strict=True):
        assert one.predicted_box == two.predicted_box and one.velocity == two.velocity


def test_unknown_target_is_named_with_those_that_are_known(scene):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    with pytest.raises(UnknownTargetError, match='no target 7; followed are none'):
        tracker.drop(7)
    for center in paths(0)[:2]:
        tracker.initialize(image, box_of(center))
    with pytest.raises(UnknownTargetError, match='no target 3; followed are 1, 2'):
        tracker.drop(3)


def test_what_is_learned_between_frames_changes_no_result(scene):
    eager, lazy = MultiTracker(), MultiTracker()
    for tracker in (eager, lazy):
        for center in paths(0):
            tracker.initialize(frame(scene, *paths(0)), box_of(center))
    for index in range(1, 6):
        image = frame(scene, *paths(index))
        said, expected = eager.update(image), lazy.update(image)
        eager.learn()
        for number, result in said.items():
            assert result.box == expected[number].box
            np.testing.assert_array_equal(result.confidence_map, expected[number].confidence_map)


def test_answer_does_not_wait_for_the_training(scene, monkeypatch):
    trained = []
    train = Detector.train
    monkeypatch.setattr(Detector, 'train', lambda self: (trained.append(self), train(self)))
    tracker = MultiTracker()
    for center in paths(0):
        tracker.initialize(frame(scene, *paths(0)), box_of(center))
    for index in range(1, 5):
        tracker.update(frame(scene, *paths(index)))
        before = len(trained)
        tracker.learn()
        assert before == len(paths(0)) * ((index - 1) // 2)
        assert len(trained) == len(paths(0)) * (index // 2)


def test_frame_is_measured_once_for_all(scene, monkeypatch):
    measured = []
    survey = targets_module.survey
    monkeypatch.setattr(targets_module, 'survey', lambda image, config: (
        measured.append(image), survey(image, config))[1])
    tracker = MultiTracker()
    for count, center in enumerate(paths(0), 1):
        tracker.initialize(frame(scene, *paths(0)), box_of(center))
        assert len(measured) == count
    tracker.update(frame(scene, *paths(1)))
    assert len(measured) == 4
    # Where a point is, the box is found in what was measured.
    tracker.initialize_at(frame(scene, *paths(1)), paths(1)[0])
    assert len(measured) == 5


def test_frame_that_does_not_fit_is_refused_before_a_point_is_looked_at(scene):
    tracker, image = MultiTracker(), frame(scene, *paths(0))
    tracker.initialize(image, box_of(paths(0)[0]), 1.0)
    for wrong, time, error in ((image[:120], 2.0, ImageError), (image, None, TimeError)):
        with pytest.raises(error):
            tracker.initialize_at(wrong, (-1, -1), time)
    assert tracker.ids == (1,)


def test_late_target_catches_up_alone(scene):
    """It goes through frames that the other has seen, as a tracker of its own would."""
    several, late = MultiTracker(), LMSCOTracker()
    images = [frame(scene, *paths(number)[:2]) for number in range(8)]
    several.initialize(images[0], box_of(paths(0)[0]))
    for image in images[1:6]:
        several.update(image)
    kept = several.results[1]
    target = several.initialize(images[2], box_of(paths(2)[1]))
    late.initialize(images[2], box_of(paths(2)[1]))
    for image in images[3:6]:
        result = several.update(image, only=(target,))
        assert set(result) == {target}
        assert_close(result[target], late.update(image))
    assert several.results[1] is kept
    for image in images[6:]:
        assert_close(several.update(image)[target], late.update(image))


class Spy:
    """Stands for a track and keeps what it is told of the others."""

    def __init__(self, result, heading, state):
        self.result, self.others = replace(result, state=state), None
        self.course = SimpleNamespace(heading=heading, check_time=lambda time: None)

    def advance(self, surveyed, time, others):
        self.others = others
        return self.result
        yield


def test_targets_know_where_those_among_them_go_that_are_not_lost(scene):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    for center in paths(0):
        tracker.initialize(image, box_of(center))
    known = tracker._targets._tracks
    for number, state in zip(known, (TrackState.TRACKING, TrackState.LOST,
                                     TrackState.UNCERTAIN), strict=True):
        known[number] = Spy(known[number].result, (number, 2 * number), state)
    tracker.update(image)
    assert [spy.others for spy in known.values()] == [[(3, 6)], [(1, 2), (3, 6)], [(1, 2)]]


@pytest.mark.parametrize('speed, gap', [(0.6, 3), (1.5, 0), (3, 6), (5, 10), (8, 20)])
def test_targets_that_look_the_same_and_cross_keep_their_numbers(scene, speed, gap):
    """
    With a tracker for each, both would go on with the same one in three of these.

    The slow ones are in one place for so long that they would turn around, if what is seen of
    both there were taken for their motion.
    """
    count = min(int(160 / speed), 150)
    way = speed * count / 2

    def crossing(number):
        return ((120 - way + speed * number, 80 - gap / 2),
                (120 + way - speed * number, 80 + gap / 2))

    tracker = MultiTracker()
    for center in crossing(0):
        tracker.initialize(frame(scene, *crossing(0)), box_of(center))
    for number in range(1, count):
        results = tracker.update(frame(scene, *crossing(number)))
    for result, center in zip(results.values(), crossing(count - 1), strict=True):
        assert result.state is TrackState.TRACKING
        assert result.box.overlap(box_of(center)) > 0.8


@pytest.mark.parametrize('duplicate', [
    copy.deepcopy, lambda tracker: pickle.loads(pickle.dumps(tracker))])
def test_copies_go_on_with_all_targets(scene, duplicate):
    tracker = MultiTracker('hcs')
    for center in paths(0):
        tracker.initialize(frame(scene, *paths(0)), box_of(center))
    other = duplicate(tracker)
    for number in range(1, 4):
        image = frame(scene, *paths(number))
        for one, two in zip(tracker.update(image).values(), other.update(image).values(),
                            strict=True):
            assert one.box == two.box and one.score == two.score
    assert other.initialize(image, box_of(paths(3)[0])) == 4


@pytest.mark.parametrize('duplicate', [
    copy.deepcopy, lambda tracker: pickle.loads(pickle.dumps(tracker))])
def test_copy_takes_no_more_threads_than_the_tracker(monkeypatch, duplicate):
    tracker, limits = MultiTracker('hcs'), []
    monkeypatch.setattr(targets_module, 'limit_threads', limits.append)
    duplicate(tracker)
    assert limits == [tracker.config.runtime.threads]


def test_one_call_at_a_time(scene):
    tracker, image = MultiTracker('hcs'), frame(scene, *paths(0))
    tracker.initialize(image, box_of(paths(0)[0]))
    with tracker._alone():
        for call in (lambda: tracker.update(image), tracker.reset, tracker.learn,
                     lambda: tracker.drop(1),
                     lambda: tracker.initialize(image, box_of(paths(0)[0]))):
            with pytest.raises(BusyError):
                call()
    assert tracker.ids == (1,)
