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

"""On which boxes of a detector the node starts, and that it does not start on others."""

from types import SimpleNamespace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from std_msgs.msg import Header

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.detection_policy import Candidate, DetectionPolicy

SIZE = (100, 80)
POLICY = DetectionPolicy('highest_score', frozenset(), 0.5, True, 1)
DOG = Candidate(BoundingBox(45, 35, 10, 10), 0.6, 'dog')
CAT = Candidate(BoundingBox(10, 10, 10, 10), 0.9, 'cat')
FAINT = Candidate(BoundingBox(70, 10, 10, 10), 0.4, 'dog')


def followed(box, state=TrackState.TRACKING):
    """Return the result of a target."""
    return TrackResult(box, 0.9, state, np.zeros((2, 2), np.float32), box)


def policy(**changes):
    """Return a policy that differs from the usual one."""
    return DetectionPolicy(**{**vars(POLICY), **changes})


@pytest.mark.parametrize('changes, expected', [
    ({}, CAT), ({'choice': 'nearest_to_center'}, DOG), ({'classes': frozenset({'dog'})}, DOG),
    ({'classes': frozenset({'bird'})}, None), ({'least_score': 0.95}, None),
    ({'classes': frozenset({'dog'}), 'least_score': 0.0}, DOG)])
def test_box_is_chosen_by_score_place_and_class(changes, expected):
    found = policy(**changes).pick([FAINT, DOG, CAT], {}, SIZE)
    assert found == (expected.box if expected else None)


@pytest.mark.parametrize('most, restart, states, is_room', [
    (1, True, [], True), (1, True, [TrackState.TRACKING], False),
    (1, True, [TrackState.UNCERTAIN], False), (1, True, [TrackState.LOST], True),
    (1, False, [TrackState.LOST], False), (2, False, [TrackState.LOST], True),
    (2, True, [TrackState.TRACKING, TrackState.LOST], True),
    (2, False, [TrackState.TRACKING, TrackState.LOST], False)])
def test_start_is_made_where_there_is_room(most, restart, states, is_room):
    results = {number: followed(BoundingBox(80, 60, 5, 5), state)
               for number, state in enumerate(states)}
    found = policy(most_targets=most, restart=restart).pick([CAT], results, SIZE)
    assert (found is not None) is is_room


@given(x=st.floats(-12, 12), state=st.sampled_from(TrackState))
def test_what_is_followed_is_not_started_on_again(x, state):
    there = BoundingBox(CAT.box.x + x, 10, 10, 10)
    found = policy(most_targets=3).pick([CAT], {1: followed(there, state)}, SIZE)
    same = state is not TrackState.LOST and there.overlap(CAT.box) > 0.2
    assert (found is None) == same


def array(*boxes, score=0.9, class_id='dog', stamp=None):
    """Return a message as vision_msgs has it, which need not be installed."""
    def detection(x, y, width, height):
        center = SimpleNamespace(position=SimpleNamespace(x=x + width / 2, y=y + height / 2))
        hypothesis = SimpleNamespace(class_id=class_id, score=score)
        return SimpleNamespace(id='', results=[SimpleNamespace(hypothesis=hypothesis)],
                               bbox=SimpleNamespace(center=center, size_x=width, size_y=height))
    header = Header() if stamp is None else Header(stamp=stamp)
    return SimpleNamespace(header=header, detections=[detection(*box) for box in boxes])


def detect(running, *boxes, **values):
    """Let the node hear of boxes."""
    running.node._session._inputs._on_detections(array(*boxes, **values))


def test_node_starts_on_a_detection_once(run):
    running = run(detection_classes='cat, dog')
    running.send()
    for _ in range(5):
        detect(running, (10, 12, 8, 6))
        running.send()
    assert [status.start for status in running.statuses].count('accepted') == 1
    assert running.send().track_id == 1 and running.last_box[1:] == (12, 8, 6)


@pytest.mark.parametrize('values', [{'class_id': 'bird'}, {'score': 0.2}])
def test_node_does_not_start_on_what_it_is_not_to(run, values):
    running = run(detection_classes='cat,dog')
    running.send()
    detect(running, (10, 12, 8, 6), **values)
    assert running.send().state == 'idle' and not running.fake.calls


def test_node_takes_the_place_of_a_lost_target_by_a_detection(run):
    running = run()
    running.start()
    running.send()
    running.fake.states = [TrackState.LOST]
    running.send()
    detect(running, (30, 12, 8, 6))
    running.send()
    answers = [status.message for status in running.statuses if status.start]
    assert answers[-1].endswith('accepted in place of target 1') and running.last_box[0] == 31


def test_detection_starts_on_its_own_image_in_pixels_of_the_full_image(run):
    running = run(crop_left=3, crop_top=2)
    images = [running.graph.image(value) for value in range(3)]
    running.send(*images)
    detect(running, (10, 12, 8, 6), stamp=images[1].header.stamp)
    running.graph.spin_until(lambda: len(running.boxes) == 2)
    assert [box.header for box in running.boxes] == [image.header for image in images[1:]]
    assert running.last_box == (11, 12, 8, 6)


def test_several_targets_are_started_one_after_the_other(run):
    running = run(max_targets=3)
    running.send()
    for _ in range(4):
        places = [result.box.as_tuple() for result in running.fake.results.values()]
        detect(running, *places, (10, 30, 8, 6), (40, 30, 8, 6))
        running.send()
    assert len(running.fake.results) == 2


def test_detection_that_is_no_box_is_refused(run):
    running = run()
    running.send()
    detect(running, (10, 12, float('nan'), 6))
    running.graph.spin_until(lambda: running.statuses[-1].start == 'refused')
    assert 'not finite' in running.statuses[-1].message


def test_detections_do_not_supersede_a_box_and_wait_while_disabled(run):
    running = run()
    detect(running, (10, 12, 8, 6))
    assert running.send().state == 'idle'
    running.node._session.worker.set_enabled(False)
    detect(running, (10, 12, 8, 6))
    assert running.send().state == 'disabled'
    assert all(status.start == '' for status in running.statuses)
    running.node._session.worker.set_enabled(True)
    image = running.graph.image()
    running.start_stamped((20, 30, 8, 6), image.header.stamp.sec * 10 ** 9
                          + image.header.stamp.nanosec)
    detect(running, (10, 12, 8, 6))
    running.send(image)
    assert running.last_box == (20, 30, 8, 6) and len(running.fake.calls) == 1
