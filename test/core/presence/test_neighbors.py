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

"""What belongs to another target that is followed as well."""

from types import SimpleNamespace

from hypothesis import given, strategies as st
import numpy as np
import pytest

from lmsco_ros.core import BoundingBox
from lmsco_ros.core.config import PresenceConfig
from lmsco_ros.core.imaging.gain import IntensityRange
from lmsco_ros.core.imaging.view import FrameView
from lmsco_ros.core.networks.together import Ask, at_once, side_by_side
from lmsco_ros.core.presence.monitor import PresenceMonitor
from lmsco_ros.core.presence.neighbors import Neighbors
from lmsco_ros.core.presence.observer import Observer, Outlook

PLACES = st.tuples(st.floats(-500, 500), st.floats(-500, 500))


@pytest.mark.parametrize('found, claimed', [
    ((30, 10), True), ((22, 10), True), ((18, 10), False), ((10, 10), False),
    ((44, 10), True), ((46, 10), False), ((30, 24), True), ((30, 26), False),
    ((10, 30), False)])
def test_what_is_nearer_to_another_and_within_its_reach_is_claimed(found, claimed):
    neighbors = Neighbors((10, 10), ((30, 10), (10, 50)))
    assert neighbors.claim(found, 20) is claimed


@given(own=PLACES, others=st.lists(PLACES, min_size=1, max_size=5).map(tuple),
       places=st.lists(PLACES, min_size=1, max_size=9))
def test_a_place_belongs_to_the_nearest(own, others, places):
    owned = Neighbors(own, others).owned(np.array(places)[:, None])
    assert owned.shape == (len(places), 1)
    for place, mine in zip(places, owned[:, 0], strict=True):
        distances = [float(np.hypot(place[0] - x, place[1] - y)) for x, y in (own, *others)]
        if abs(distances[0] - min(distances[1:])) > 1e-9:
            assert mine == (distances[0] < min(distances[1:]))


@given(own=PLACES, others=st.lists(PLACES, min_size=1, max_size=5).map(tuple))
def test_nobody_claims_where_the_target_itself_is_expected(own, others):
    assert not Neighbors(own, others).claim(own, 20.0)


@pytest.mark.parametrize('other, merged', [
    ((19, 10), True), ((21, 10), False), ((10, 1), True), ((10, 10), True), ((18, 18), False)])
def test_targets_that_get_to_the_same_place_are_merged(other, merged):
    assert Neighbors((10, 10), ((90, 90), other)).merged(20) is merged


@pytest.mark.parametrize('other, touched', [
    ((39, 10), True), ((41, 10), False), ((10, -19), True)])
def test_targets_that_may_be_measured_as_one_touch(other, touched):
    assert Neighbors((10, 10), ((90, 90), other)).touched(20) is touched


class Detector:
    """Sees the next of what it is told to see; near a place, something at that place."""

    def __init__(self, *centers):
        self.next, self.neared = [seen(center) for center in centers], []

    def ask(self, view, box, factors):
        return (yield Ask('detector', lambda turns: [turn.pop(0) for turn in turns], self.next))

    def likeness(self, detection):
        return 1.0

    def near(self, detection, place, *owned):
        self.neared.append((detection, place, *owned))
        return seen(place)


def seen(center):
    """Return a detection of something like the target."""
    return SimpleNamespace(center=center, sharpness=10.0)


OWN = Neighbors((112.0, 84.0), ((130.0, 84.0), (160.0, 80.0)))
LAST = BoundingBox.from_center((110, 84), (20, 20))
VIEW = FrameView(np.zeros((240, 320), np.uint8), IntensityRange(0, 1))
OUTLOOK = Outlook(VIEW, LAST, LAST, LAST, OWN)


def observing(detector):
    """Return an observer that measures nothing."""
    return Observer(detector, None, PresenceMonitor(PresenceConfig()), seen((0, 0)))


def test_target_is_looked_for_where_no_neighbor_is_expected():
    detector = Detector((124.0, 84.0), (118.0, 84.0))
    neighbor, elsewhere = detector.next
    observer = observing(detector)
    assert at_once(observer.look(OUTLOOK, (1.0,))).detection.center == OWN.own
    assert detector.neared == [(neighbor, OWN.own, OWN.owned)]
    # What is nearer to the target itself is not asked for twice.
    assert at_once(observer.look(OUTLOOK, (1.0,))).detection is elsewhere


def test_neighbor_is_a_distractor():
    observer = observing(Detector())
    assert observer.is_distractor(OUTLOOK, seen((170.0, 80.0)))
    assert not observer.is_distractor(OUTLOOK, seen((180.0, 80.0)))


def test_several_targets_are_looked_for_side_by_side():
    detectors = [Detector((110.0 + number, 84.0)) for number in range(3)]
    found = side_by_side({number: observing(detector).look(OUTLOOK, (1.0,))
                          for number, detector in enumerate(detectors)})
    assert [sighting.detection.center[0] for sighting in found.values()] == [110, 111, 112]
