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

"""What speaks for a detection: the detector and the network are replaced."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.extent.measurement import Measurement
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import Ask, at_once
from lmsco_ros.core.presence.evidence import Evidence
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.observer import Observer, Outlook

LAST = BoundingBox.from_center((100, 80), (20, 16))
EXPECTED = BoundingBox.from_center((110, 84), (20, 20))
TWIN = (160.0, 80.0)
FIRST = SimpleNamespace(center=LAST.center, sharpness=10.0, likeness=0.5)


class Detector:
    """Sees the next of what it is told to see; near a place, something at that place."""

    def __init__(self):
        self.next, self.calls, self.neared, self.passes = [], [], [], []

    def __call__(self, view, box, factors=(1.0,)):
        self.calls.append((view, box, factors))
        return self.next.pop(0) if self.next else seen(box.center)

    def ask(self, view, box, factors=(1.0,)):
        return (yield Ask('detector', self.answers, (view, box, factors)))

    def answers(self, turns):
        self.passes.append(len(turns))
        return [self(*turn) for turn in turns]

    def likeness(self, detection):
        return detection.likeness

    def near(self, detection, place):
        self.neared.append((detection, place))
        return seen(place, detection.sharpness)


def seen(center, sharpness=10.0, likeness=0.25):
    """Return a detection of something like the target."""
    return SimpleNamespace(center=center, sharpness=sharpness, likeness=likeness)


@pytest.fixture
def detector():
    return Detector()


class Meter:
    """Gives everything log-odds of 3, unless told."""

    def __init__(self):
        self.presence, self.calls, self.measurements = 3.0, [], []
        self.odds, self.passes = [], []

    def ask(self, view, box):
        self.calls.append((view, box))
        return (yield Ask('meter', self.answers, box))

    def __call__(self, view, box):
        return at_once(self.ask(view, box))

    def answers(self, turns):
        self.passes.append(len(turns))
        return [self.measured() for _ in turns]

    def measured(self):
        edges, odds = np.array([[100, 118], [70, 92]]), self.odds or [self.presence]
        self.measurements.append(Measurement(edges, np.ones((2, 2)), odds.pop(0)))
        return self.measurements[-1]


@pytest.fixture
def meter():
    return Meter()


@pytest.fixture
def monitor():
    return PresenceMonitor(PresenceConfig())


@pytest.fixture
def observer(detector, meter, monitor):
    return Observer(detector, meter, monitor, FIRST)


def view():
    """Return a frame."""
    return FrameView(np.zeros((240, 320), np.uint8), IntensityRange(0, 1))


@pytest.fixture
def outlook():
    return Outlook(view(), LAST, EXPECTED, LAST)


def look(observer, outlook, factors=(1.0,)):
    """Return what an observer sees, asked alone."""
    return at_once(observer.look(outlook, factors))


def test_target_is_looked_for_where_it_is_expected(observer, detector, outlook):
    detector.next = [seen((112.0, 85.0))]
    sighting = look(observer, outlook, (0.9, 1.0))
    assert detector.calls == [(outlook.view, EXPECTED, (0.9, 1.0))]
    assert sighting.detection.center == (112.0, 85.0)
    assert detector.neared == []


def test_evidence_is_measured_against_first_frame_and_expected_place(
        observer, detector, monitor, outlook):
    detector.next = [seen((122.0, 89.0), sharpness=7.0, likeness=0.25)]
    sighting = look(observer, outlook)
    evidence = sighting.assessment.evidence
    # The filter of the first frame says half of what it did there; edges are off by a pixel
    # of the 20 of a side; the jump is 13 pixels.
    assert evidence == Evidence(7.0, 0.5, 3.0, 1 / 20, pytest.approx(13 / 20))
    assert sighting.assessment == monitor.assess(evidence)


def test_found_place_is_measured_in_the_looked_for_size(observer, detector, meter, outlook):
    detector.next = [seen((122.0, 89.0))]
    sighting = look(observer, outlook)
    assert meter.calls == [(outlook.view, EXPECTED.moved_to((122.0, 89.0)))]
    assert [sighting.measurement] == meter.measurements


def test_nothing_is_measured_without_a_network(detector, monitor, outlook):
    sighting = look(Observer(detector, None, monitor, FIRST), outlook)
    evidence = sighting.assessment.evidence
    assert evidence.presence is None and evidence.vagueness is None
    assert sighting.measurement is None


def test_first_frame_is_measured_as_all_others(observer, meter):
    first, box = view(), BoundingBox(10, 20, 40, 10)
    assert observer.introduce(first, box) == Evidence(FIRST.sharpness, 1.0, 3.0, 1 / 20)
    assert meter.calls == [(first, box)]


def test_first_frame_tells_what_there_is_without_a_network(detector, monitor):
    observer = Observer(detector, None, monitor, FIRST)
    assert observer.introduce(view(), LAST) == Evidence(FIRST.sharpness)
    outlook = Outlook(view(), LAST, EXPECTED, LAST)
    assert observer.presence(outlook, [LAST, EXPECTED]) == [None, None]


def test_places_are_measured_in_one_pass_without_the_filter(observer, detector, meter, outlook):
    meter.odds = [0.5, -2.0]
    assert observer.presence(outlook, [LAST, EXPECTED]) == [0.5, -2.0]
    assert meter.calls == [(outlook.view, LAST), (outlook.view, EXPECTED)]
    assert meter.passes == [2] and detector.calls == []
    assert observer.presence(outlook, []) == []


def test_sighting_is_found_where_it_was_detected(observer, detector, outlook):
    detector.next = [seen((122.0, 89.0))]
    assert look(observer, outlook).found == EXPECTED.moved_to((122.0, 89.0))


@pytest.fixture
def entering():
    """Return a frame after one in which the left border has cut the target."""
    last = BoundingBox(0, 70, 12, 20)
    return Outlook(view(), last, last, last)


def test_what_moves_in_reaches_to_the_border_that_has_cut_it(
        observer, detector, meter, entering):
    # Its middle was 6 pixels from the border and is 11 now; 12 + 5 pixels of it are in view.
    detector.next = [seen((11.0, 80.0))]
    sighting = look(observer, entering)
    assert sighting.found == BoundingBox(0, 70, 17, 20)
    assert meter.calls == [(entering.view, sighting.found)]


def test_what_was_missed_meanwhile_has_the_size_of_before(observer, detector, entering):
    detector.next = [seen((11.0, 80.0))]
    assert look(observer, replace(entering, misses=1)).found == BoundingBox(5, 70, 12, 20)


def test_what_is_not_measured_keeps_its_size(detector, monitor, entering):
    detector.next = [seen((11.0, 80.0))]
    observer = Observer(detector, None, monitor, FIRST)
    assert look(observer, entering).found == BoundingBox(5, 70, 12, 20)


def test_what_is_found_elsewhere_reaches_to_no_border(observer, entering):
    box = BoundingBox(5, 70, 12, 20)
    assert [one.found for one in observer.weigh(entering, [seen(box.center)], [box])] == [box]


def test_new_detector_is_measured_by_its_own_first_frame(observer, monitor, outlook):
    other = Detector()
    observer.begin(other, SimpleNamespace(center=LAST.center, sharpness=4.0, likeness=0.125))
    other.next = [seen((112.0, 85.0), sharpness=7.0, likeness=0.25)]
    evidence = look(observer, outlook).assessment.evidence
    assert (evidence.sharpness, evidence.likeness) == (7.0, 2.0)
    assert observer.introduce(view(), LAST).sharpness == 4.0


def test_odds_of_zero_are_odds(observer, meter, outlook):
    meter.presence = 0.0
    assert look(observer, outlook).assessment.evidence.presence == 0.0


def test_detections_elsewhere_are_weighed_in_their_own_boxes(observer, detector, meter, outlook):
    boxes = [BoundingBox.from_center((200, 150), (14, 11)), BoundingBox(20, 30, 10, 16)]
    detector.next = [seen((200, 150)), seen((27, 40))]
    seen_there = observer.detect(outlook, boxes)
    assert detector.calls == [(outlook.view, box, (1.0,)) for box in boxes]
    meter.odds = [2.0, -1.0]
    sightings = observer.weigh(outlook, seen_there, boxes)
    found = [boxes[0], BoundingBox(22, 32, 10, 16)]
    assert [sighting.found for sighting in sightings] == found
    assert [sighting.detection for sighting in sightings] == seen_there
    assert meter.calls == [(outlook.view, box) for box in found]
    evidence = [sighting.assessment.evidence for sighting in sightings]
    assert evidence[0].jump == pytest.approx(np.hypot(90, 66) / 20)
    assert [one.presence for one in evidence] == [2.0, -1.0]


def test_networks_see_all_places_in_one_pass(observer, detector, meter, outlook):
    boxes = [LAST, EXPECTED, LAST.moved_to(TWIN)]
    observer.weigh(outlook, observer.detect(outlook, boxes), boxes)
    assert detector.passes == meter.passes == [3]
    assert observer.weigh(outlook, observer.detect(outlook, []), []) == []


@pytest.fixture
def with_twin(observer, outlook):
    """Return an observer that knows a distractor from a frame in which the target was certain."""
    observer.keep(outlook.view, LAST)
    assert observer.is_distractor(outlook, seen(TWIN))
    return observer


def test_what_was_there_beside_the_target_is_a_distractor(with_twin, detector, outlook):
    # The kept frame was asked what it shows there, in the size of the target.
    asked, box, _ = detector.calls[0]
    assert np.array_equal(asked.image, outlook.view.image)
    assert asked is not outlook.view and box == LAST.moved_to(TWIN)
    assert detector.neared[0][1] == TWIN


def test_what_was_not_there_is_none(observer, meter, outlook):
    meter.presence = -8.0
    observer.keep(outlook.view, LAST)
    assert not observer.is_distractor(outlook, seen(TWIN))


def test_kept_frame_is_asked_for_the_peak_at_the_place_itself(observer, detector, outlook):
    # Something else stands out in the region, and what is measured lies where it was asked for.
    observer.keep(outlook.view, LAST)
    detector.next = [seen((180.0, 90.0), likeness=-5.0)]
    assert observer.is_distractor(outlook, seen(TWIN))
    assert detector.neared[0][0].center == (180.0, 90.0)


def test_without_a_kept_frame_there_is_no_distractor(observer, outlook):
    assert not observer.is_distractor(outlook, seen(TWIN))


def test_forgotten_distractors_are_none(with_twin, outlook):
    with_twin.forget()
    assert not with_twin.is_distractor(outlook, seen(TWIN))


def test_target_is_looked_for_beside_a_distractor(with_twin, detector, outlook):
    distractor = seen(TWIN)
    detector.next, detector.neared = [distractor], []
    sighting = look(with_twin, outlook)
    assert detector.neared == [(distractor, EXPECTED.center)]
    assert sighting.detection.center == EXPECTED.center


def test_what_was_just_seen_is_looked_back_for_once(observer, detector, meter, outlook):
    observer.keep(outlook.view, LAST)
    detector.next, meter.odds = [seen(TWIN)], [-8.0, 3.0]
    assert look(observer, outlook).detection.center == TWIN
    # In this frame, and in the kept one.
    assert len(detector.calls) == 2


@pytest.fixture
def lost(monitor):
    """Let the target have been lost for a while."""
    for _ in range(30):
        monitor.judge(monitor.assess(Evidence(0.0)))
    assert not monitor.hurried


def test_lost_target_waits_for_what_would_be_believed_before_it_looks_back(
        observer, detector, meter, outlook, lost):
    observer.keep(outlook.view, LAST)
    meter.presence, detector.next = -8.0, [seen(TWIN, sharpness=1.0)]
    sighting = look(observer, outlook)
    assert sighting.detection.center == TWIN
    assert detector.calls == [(outlook.view, EXPECTED, (1.0,))] and detector.neared == []


def test_lost_target_is_not_found_in_a_distractor(
        observer, detector, outlook, lost, monkeypatch, monitor):
    monkeypatch.setattr(monitor, 'believable', lambda seen: True)
    observer.keep(outlook.view, LAST)
    detector.next = [distractor := seen(TWIN)]
    sighting = look(observer, outlook)
    assert detector.neared[-1] == (distractor, EXPECTED.center)
    assert (sighting.detection.center, sighting.found.center) == (EXPECTED.center,) * 2


def test_known_distractors_are_watched_where_they_were(with_twin, detector, outlook):
    moved = (TWIN[0] + 10, TWIN[1])
    detector.calls, detector.next = [], [seen(moved)]
    with_twin.follow_distractors(outlook)
    assert detector.calls == [(outlook.view, EXPECTED.moved_to(TWIN), (1.0,))]
    # It has taken a step since, and is known at the new place: two steps would be too many.
    detector.calls, detector.next = [], []
    with_twin.follow_distractors(outlook)
    assert detector.calls == [(outlook.view, EXPECTED.moved_to(moved), (1.0,))]


def test_frames_are_counted_and_distractors_forgotten_in_time(with_twin, meter, outlook):
    meter.presence = -8.0
    for _ in range(60):
        look(with_twin, outlook)
    assert with_twin.is_distractor(outlook, seen(TWIN))
    look(with_twin, outlook)
    assert not with_twin.is_distractor(outlook, seen(TWIN))
