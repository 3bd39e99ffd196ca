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

"""What is looked at while the target is missing, and what of it is taken for the target."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import create_autospec, Mock

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.config import SearchConfig
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.regions import search_tiles
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.observer import Outlook
from lmsco_ros.core.search import redetection as redetection_module
from lmsco_ros.core.search.redetection import Redetection
from lmsco_ros.core.search.salience import Salience

IMAGE_SIZE, SIDE = (320, 240), 80.0
CONFIG = SearchConfig(candidates=2, tiles=3)
LAST = BoundingBox.from_center((60, 50), (20, 16))
EXPECTED = BoundingBox.from_center((70, 60), (20, 16))
AHEAD = BoundingBox.from_center((300, 30), (20, 16))
# More than there are turns for: two in each of three frames.
SALIENT = [BoundingBox.from_center((40 * n + 20, 200 - 10 * n), (14, 11)) for n in range(7)]


class Observer:
    """Sees, with a sharpness and a score for each place, what is told to be there."""

    def __init__(self):
        self.seen, self.looked, self.asked, self.distractors = {}, [], [], []
        self.measured, self.odds = [], {}
        self.detected, self.followed = [], []

    def put(self, place, **what):
        """Let something be seen at a place; by default nothing is, of sharpness and score 0."""
        self.seen[place] = what

    def detect(self, outlook, boxes):
        assert len(self.followed) == 1
        return [self.detected_at(box) for box in boxes]

    def detected_at(self, box):
        self.detected.append(box)
        what = {'sharpness': 0.0, 'center': box.center, **self.seen.get(box.center, {})}
        return SimpleNamespace(region=BoundingBox.from_center(box.center, (99, 99)), **what)

    def weigh(self, outlook, seen, boxes):
        return [self.weighed(*one) for one in zip(seen, boxes, strict=True)]

    def weighed(self, detection, box):
        self.looked.append(box)
        score = self.seen.get(box.center, {}).get('score', 0.0)
        return SimpleNamespace(found=box, detection=detection,
                               assessment=SimpleNamespace(score=score, place=box.center))

    def presence(self, outlook, boxes):
        self.measured += boxes
        return [self.odds.get(box.center, -1.0) for box in boxes]

    def is_distractor(self, outlook, detection):
        self.asked.append(detection.center)
        return detection.center in self.distractors

    def follow_distractors(self, outlook):
        self.followed.append(outlook)


@pytest.fixture
def observer():
    return Observer()


@pytest.fixture
def monitor():
    """Return a monitor in which the target is lost and everything convinces."""
    monitor = create_autospec(PresenceMonitor, instance=True)
    monitor.hurried, monitor.after_cut = False, False
    monitor.convincing.return_value = monitor.hints.return_value = True
    monitor.present.side_effect = lambda presence: presence >= 0
    return monitor


@pytest.fixture
def salience(monkeypatch):
    """Replace the salience: it always finds the same places."""
    salience = create_autospec(Salience, instance=True)
    salience.candidates.return_value = list(SALIENT)
    monkeypatch.setattr(redetection_module, 'Salience', Mock(return_value=salience))
    return salience


@pytest.fixture
def outlook():
    image = np.zeros(IMAGE_SIZE[::-1], np.uint8)
    return Outlook(FrameView(image, IntensityRange(0, 1)), LAST, EXPECTED, AHEAD)


@pytest.fixture
def here():
    """Return what is where the target was expected; its score is 0.5."""
    return SimpleNamespace(
        detection=SimpleNamespace(region=BoundingBox.from_center(EXPECTED.center, (SIDE, SIDE))),
        assessment=SimpleNamespace(score=0.5))


@pytest.fixture
def redetect(observer, monitor, salience, outlook, here):
    """Return the search, as a function of the frames since the target was seen."""
    redetection = Redetection(CONFIG, observer, monitor, outlook.view, LAST)

    def search(misses=0, after_shutter=False):
        for made in (observer.detected, observer.looked, observer.asked, observer.followed,
                     observer.measured):
            made.clear()
        return redetection(replace(outlook, misses=misses), here, after_shutter=after_shutter)
    search.restart = redetection.restart
    return search


def tiles():
    """Return the tiles of the image, nearest first."""
    return search_tiles(IMAGE_SIZE, SIDE, EXPECTED.center)


def places(boxes):
    """Return the centers of boxes."""
    return [box.center for box in boxes]


def test_salience_is_that_of_the_first_frame(redetect, outlook):
    redetection_module.Salience.assert_called_once_with(outlook.view, LAST)


def test_distractors_are_watched_first(redetect, observer, outlook):
    redetect()
    assert observer.followed == [outlook]


NEARBY = [BoundingBox.from_center(place, (14, 11)) for place in ((90, 60), (60, 95), (70, 70))]
FURTHER = [BoundingBox.from_center(place, (14, 11)) for place in ((290, 40), (250, 20))]


@pytest.mark.parametrize('misses, measured', [
    (6, NEARBY[0]), (8, FURTHER[0]), (10, SALIENT[1]), (16, SALIENT[2])])
def test_lost_target_is_measured_at_salient_places_nearby_ahead_and_anywhere(
        redetect, observer, salience, outlook, misses, measured):
    salience.candidates.return_value = SALIENT + NEARBY + FURTHER
    redetect(misses)
    assert observer.measured == [measured] and observer.detected == []
    salience.candidates.assert_called_once_with(outlook.view, EXPECTED, 48, (1.0,))


def test_filter_looks_where_the_network_is_surest_to_see_the_target(
        observer, monitor, salience, outlook, here):
    redetection = Redetection(SearchConfig(candidates=6), observer, monitor, outlook.view, LAST)
    observer.odds = {SALIENT[0].center: 0.5, SALIENT[1].center: 2.0}
    observer.put(SALIENT[1].center, score=0.9)
    after_some = replace(outlook, misses=4)
    assert redetection(after_some, here, after_shutter=False).found == SALIENT[1]
    assert observer.measured == SALIENT[:3]
    assert observer.detected == observer.looked == [SALIENT[1]]


def test_filter_looks_at_the_most_salient_place_where_nothing_measures(redetect, observer):
    observer.odds = dict.fromkeys((box.center for box in SALIENT), None)
    redetect(10)
    assert observer.detected == [SALIENT[1]]


def test_blunt_tile_is_not_looked_at_again_while_lost(redetect, observer, monitor):
    monitor.hints.side_effect = lambda sharpness: sharpness >= 4.0
    observer.put(tiles()[0], sharpness=3.9)
    observer.put(tiles()[3], sharpness=4.1)
    redetect(7)
    assert len(observer.detected) == 3 and observer.looked == []
    redetect(9)
    assert observer.looked == [EXPECTED.moved_to(tiles()[3])]


def test_lost_frames_cost_no_more_than_one_and_a_half_looks(redetect, observer, monitor):
    """Beside the look at the expected place; a measurement costs half of what a filter does."""
    monitor.hints.return_value = False
    cost = 0.0
    for misses in range(6, 66):
        redetect(misses)
        cost += len(observer.detected) * 2 / CONFIG.tiles + len(observer.measured) / 2
    assert cost / 60 <= 1.5


def test_every_other_frame_of_a_lost_target_searches_tiles(redetect, observer, salience):
    searched = []
    for misses in (5, 7, 9):
        redetect(misses)
        searched += observer.detected[:3]
        assert len(observer.detected) == 4
    salience.candidates.assert_not_called()
    assert places(searched) == tiles()[:9]
    assert {box.size for box in searched} == {EXPECTED.size}


@pytest.mark.parametrize('misses', [1, 4])
def test_target_that_was_just_seen_is_looked_for_everywhere(redetect, observer, monitor, misses):
    monitor.hurried = True
    redetect(misses)
    assert places(observer.detected[:3]) == tiles()[:3]
    assert observer.detected[3:] == observer.looked == [*SALIENT[2:4], observer.detected[5]]


@pytest.mark.parametrize('misses', [0, 3])
def test_two_slices_are_searched_after_the_shutter_and_the_salient_places(
        redetect, observer, misses):
    redetect(misses, after_shutter=True)
    assert places(observer.detected[:6]) == tiles()[:6] and len(observer.detected) == 9
    assert observer.detected[6:8] == SALIENT[:2]


def test_other_sizes_are_considered_after_a_cut(redetect, monitor, salience, outlook):
    monitor.after_cut = True
    redetect()
    salience.candidates.assert_called_once_with(outlook.view, EXPECTED, 48, (1.0, 0.7, 1.4))


def test_restarted_search_begins_with_the_nearest_tiles(redetect, observer):
    redetect(1)
    redetect.restart()
    redetect(3)
    assert places(observer.detected[:3]) == tiles()[:3]


def test_sharpest_tile_is_looked_at_again_where_its_peak_is(redetect, observer):
    first, second, third = tiles()[:3]
    observer.put(first, sharpness=3.0)
    observer.put(second, sharpness=9.0, center=(33.0, 44.0))
    observer.put(third, sharpness=6.0)
    observer.put((33.0, 44.0), score=0.9)
    found = redetect(1)
    assert observer.looked == [EXPECTED.moved_to((33.0, 44.0))] == observer.detected[3:]
    assert found.found == EXPECTED.moved_to((33.0, 44.0))


def test_what_convinces_most_is_taken_for_the_target(redetect, observer, monitor):
    monitor.hurried = True
    observer.put(SALIENT[0].center, score=0.7)
    observer.put(SALIENT[1].center, score=0.8)
    assert redetect().found == SALIENT[1]
    observer.put(tiles()[0], score=0.9, sharpness=5.0)
    redetect.restart()
    assert redetect().found.center == tiles()[0]
    # Whether the best one is a distractor is asked first, and no other one then.
    assert observer.asked == [tiles()[0]]


def test_next_best_is_taken_where_the_best_does_not_convince(redetect, observer, monitor):
    monitor.hurried = True
    observer.put(SALIENT[0].center, score=0.7)
    observer.put(SALIENT[1].center, score=0.8)
    monitor.convincing.side_effect = lambda assessment: assessment.place == SALIENT[0].center
    assert redetect().found == SALIENT[0]


def test_distractor_is_not_taken_for_the_target(redetect, observer, monitor, here):
    monitor.hurried = True
    observer.put(SALIENT[0].center, score=0.7)
    observer.put(SALIENT[1].center, score=0.8)
    observer.distractors = [SALIENT[1].center]
    assert redetect().found == SALIENT[0]
    observer.distractors.append(SALIENT[0].center)
    assert redetect() is here


@pytest.mark.parametrize('score', [0.5, 0.4])
def test_what_is_not_better_elsewhere_stays_here(redetect, observer, monitor, here, score):
    monitor.hurried = True
    observer.put(SALIENT[0].center, score=score)
    assert redetect() is here
    assert observer.asked == []


@pytest.mark.parametrize('misses', [0, 1])
def test_nothing_is_searched_where_nothing_is_asked_for(
        observer, monitor, salience, outlook, here, misses):
    redetection = Redetection(SearchConfig(0, 0), observer, monitor, outlook.view, LAST)
    outlook = replace(outlook, misses=misses)
    assert redetection(outlook, here, after_shutter=True) is here
    assert observer.detected == [] and observer.followed == [outlook]
    salience.candidates.assert_not_called()
