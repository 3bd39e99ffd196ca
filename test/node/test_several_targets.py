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

"""Several targets over real ROS messages: started, told apart, selected, given up."""

import time
from unittest.mock import Mock

from geometry_msgs.msg import PolygonInstanceStamped
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from sensor_msgs.msg import Image, RegionOfInterest
from std_msgs.msg import UInt32
from std_srvs.srv import Trigger
from visualization_msgs.msg import ImageMarker

from lmsco_ros.core.errors import BoxError
from lmsco_ros.core.types import TrackState
from msg_adapters.boxes import box_from_polygon
from msg_adapters.image import image_from_message
from msg_adapters.markers import box_from_marker
from msg_adapters.status import Level, statuses_from_message

MARGIN = dict(crop_left=3, crop_top=2)


def statuses(running, image=None):
    """Return what was said of the targets: last, or of an image."""
    messages = running._status_messages
    message = messages[-1] if image is None else running.graph.answer(messages, image)
    return statuses_from_message(message)


@pytest.fixture
def several(run):
    """Return a node with two targets of at most three; both were answered once."""
    def start(**values):
        running = run(max_targets=3, **values)
        running.instances = running.graph.listen(
            PolygonInstanceStamped, 'lmsco_tracker/boxes')
        running.select = running.graph.publisher(UInt32, 'select')
        running.send()
        for number, x in ((1, 10), (2, 30)):
            running.start(x, 12, 8, 6)
            running.graph.spin_until(
                lambda: any(status.start == 'accepted' and status.track_id == number
                            for status in running.statuses))
        return running
    return start


def boxes(running, image):
    """Return the boxes of ~/boxes for an image, by the numbers of the targets."""
    return {message.polygon.id: tuple(
        box_from_polygon(Mock(polygon=message.polygon.polygon)))
        for message in running.instances if message.header == image.header}


def choose(running, number):
    """Select a target, and wait until that was heard."""
    running.select.publish(UInt32(data=number))
    running.settle()


def test_every_target_is_told_on_boxes_and_status(several):
    running = several()
    image = running.graph.image()
    running.send(image)
    running.graph.spin_until(lambda: len(boxes(running, image)) == 2)
    assert boxes(running, image) == {1: (11, 12, 8, 6), 2: (31, 12, 8, 6)}
    # The selected one, which is the latest, comes first, and is the only one on ~/box.
    assert [(s.track_id, s.state) for s in statuses(running, image)] == [
        (2, 'tracking'), (1, 'tracking')]
    assert running.last_box == (31, 12, 8, 6)
    entries = running._status_messages[-1].status
    assert [entry.hardware_id for entry in entries] == ['target_2', 'target_1']


def test_boxes_are_in_pixels_of_the_full_image(several):
    running = several(**MARGIN)
    image = running.graph.image()
    running.send(image)
    running.graph.spin_until(lambda: len(boxes(running, image)) == 2)
    assert boxes(running, image) == {1: (11, 12, 8, 6), 2: (31, 12, 8, 6)}


def test_lost_target_has_a_status_and_no_box(several):
    running = several()
    running.fake.states = [TrackState.LOST, TrackState.TRACKING]
    image, later = running.graph.image(), running.graph.image()
    running.send(image, later)
    running.graph.spin_until(lambda: len(boxes(running, later)) == 2)
    assert set(boxes(running, image)) == {2}
    assert [(s.track_id, s.state, s.level) for s in statuses(running, image)] == [
        (2, 'tracking', Level.OK), (1, 'lost', Level.WARN)]


def test_selected_target_is_what_box_and_map_speak_of(several):
    running = several()
    maps = running.graph.listen(Image, 'lmsco_tracker/confidence_map')
    choose(running, 1)
    image = running.graph.image()
    assert running.send(image).track_id == 1
    assert running.last_box == (11, 12, 8, 6)
    rows, columns = np.nonzero(image_from_message(running.graph.answer(maps, image)))
    assert (rows.min(), columns.min(), columns.max()) == (12, 11, 18)
    # While it is lost nothing is said on ~/box, whatever the other one does.
    running.fake.states = [TrackState.LOST, TrackState.TRACKING]
    count = len(running.boxes)
    assert running.send().state == 'lost'
    assert running.send().state == 'tracking' and len(running.boxes) == count + 1
    choose(running, 2)
    running.send()
    assert running.last_box[0] == 34
    # A new one is selected.
    running.start(50, 12, 8, 6)
    assert running.send().track_id == 3


@pytest.mark.parametrize('number', [0, 3, 2 ** 32 - 1])
def test_unknown_target_cannot_be_selected(several, number):
    running = several()
    running.select.publish(UInt32(data=number))
    running.graph.spin_until(lambda: running.statuses[-1].state == 'refused')
    status = running.statuses[-1]
    assert f'no target {number} to select; followed are 1, 2' in status.message
    assert status.start == '' and running.send().track_id == 2


def test_every_start_is_answered(several):
    running = several()
    accepted = [status for status in running.statuses if status.start]
    assert [(s.start, s.track_id, s.state) for s in accepted] == [
        ('accepted', 1, 'tracking'), ('accepted', 2, 'tracking')]
    assert all(s.message == 'tracking; the start is accepted' for s in accepted)
    running.send()
    assert running.statuses[-1].start == ''


def test_start_beyond_the_most_names_whom_it_replaces(several):
    running = several()
    running.start(40, 12, 8, 6)
    running.graph.spin_until(lambda: running.statuses[-1].track_id == 3)
    choose(running, 2)
    running.start(50, 12, 8, 6)
    running.graph.spin_until(lambda: running.statuses[-1].track_id == 4)
    assert running.statuses[-1].message.endswith('accepted in place of target 2')
    image = running.graph.image()
    running.send(image)
    assert {status.track_id for status in statuses(running, image)} == {1, 3, 4}


def test_replacement_is_told_with_one_target_as_well(running):
    for number in (1, 2):
        running.start()
        assert running.send().track_id == number
    answers = [status.message for status in running.statuses if status.start]
    assert answers == ['tracking; the start is accepted',
                       'tracking; the start is accepted in place of target 1']


@pytest.mark.parametrize('publish, reason', [
    (lambda running: running.init_box.publish(RegionOfInterest()), 'empty'),
    (lambda running: running.start_stamped((1, 2, 3, 4), 1), 'stamp 0.000000001'),
    (lambda running: setattr(running.fake, 'error', BoxError('too small')) or running.start(),
     'too small'),
    (lambda running: setattr(running.fake, 'error', RuntimeError('broken')) or running.start(),
     'RuntimeError: broken')])
def test_refused_start_is_answered_with_the_reason(several, publish, reason):
    running = several()
    publish(running)
    running.graph.spin_until(lambda: running.statuses[-1].start == 'refused')
    status = running.statuses[-1]
    assert reason in status.message and status.level == Level.ERROR


def test_refused_start_on_a_coming_frame_has_an_entry_beside_those_of_the_targets(several):
    running = several()
    image = running.graph.image()
    stamp = image.header.stamp
    running.start_stamped((1, 2, 3, 4), stamp.sec * 10 ** 9 + stamp.nanosec)
    running.fake.initialize = Mock(side_effect=BoxError('too small'))
    running.send(image)
    assert [(s.track_id, s.state, s.start) for s in statuses(running, image)] == [
        (2, 'tracking', ''), (1, 'tracking', ''), (2, 'refused', 'refused')]


def test_image_that_cannot_be_read_is_no_refused_start(several):
    running = several()
    broken = running.graph.image()
    broken.encoding = 'nonsense'
    assert running.send(broken).start == ''


def test_as_many_as_there_may_be_are_started_and_told_at_once(run):
    """All starts, and all answers to a frame, are said before anybody listens again."""
    running = run(max_targets=64)
    topics = [running.graph.listen(kind, f'lmsco_tracker/{name}') for name, kind in (
        ('boxes', PolygonInstanceStamped), ('state', Odometry), ('marker', ImageMarker))]
    running.send()
    for x in range(64):
        running.init_box.publish(RegionOfInterest(x_offset=x % 50, y_offset=12, width=8, height=6))
    running.settle()
    running.graph.spin_until(lambda: len(running.fake.results) == 64)
    running.send()
    worker, image = running.node._session.worker, running.graph.image()
    running.fake.gate.clear()
    running.images.publish(image)
    running.graph.spin_until(lambda: worker.busy_seconds)
    running.fake.gate.set()
    while worker.busy_seconds:
        time.sleep(0.001)
    for messages in topics:
        running.graph.spin_until(lambda: sum(
            message.header == image.header for message in messages) == 64)
    kept = {publisher.topic_name.rpartition('/')[2]: publisher.qos_profile.depth
            for publisher in running.node.publishers}
    assert {kept[name] for name in ('boxes', 'state', 'marker')} == {640} and kept['box'] == 10


def test_reset_drops_all(several):
    running = several()
    assert running.graph.call(Trigger, 'lmsco_tracker/reset').message == 'all targets are dropped'
    image = running.graph.image()
    assert running.send(image).state == 'idle' and not running.fake.results
    assert boxes(running, image) == {}
    running.start()
    # Numbers are never used again.
    assert running.send().track_id == 3


def test_lost_target_is_dropped_in_time(several):
    running = several(drop_after=2.0)
    second = 10 ** 9
    running.send(running.graph.image(stamp=10 * second))
    told = []
    for seconds in (11, 12, 14, 15):
        running.fake.states = [TrackState.LOST, TrackState.TRACKING]
        image = running.graph.image(stamp=seconds * second)
        running.send(image)
        told.append({s.track_id: s.message for s in statuses(running, image)})
    assert told[1][1].startswith('lost: no box')
    assert 'drop_after' in told[2][1] and set(told[3]) == {2}


def test_overlay_tells_the_targets_apart(several):
    running = several()
    overlays = running.graph.listen(Image, 'lmsco_tracker/overlay')
    image = running.graph.image(1000)
    running.send(image)
    drawn = image_from_message(running.graph.answer(overlays, image))
    # Both boxes, and the numbers below them.
    assert all((drawn[15, x - 2:x + 3] != drawn[40, 60]).any() for x in (11, 31))
    assert all((drawn[20:30, x:x + 8] != drawn[40, 60]).any() for x in (11, 31))


def outlines(markers, image):
    """Return the boxes that the markers of an image draw, None where one is taken away."""
    return {marker.id: box_from_marker(marker) for marker in markers
            if marker.header == image.header}


def test_every_target_has_a_marker_of_its_own(several):
    running = several()
    markers = running.graph.listen(ImageMarker, 'lmsco_tracker/marker')
    image, lost, dropped = (running.graph.image() for _ in range(3))
    running.send(image)
    running.graph.spin_until(lambda: len(outlines(markers, image)) == 2)
    assert outlines(markers, image) == {1: (11, 12, 8, 6), 2: (31, 12, 8, 6)}
    running.fake.states = [TrackState.LOST, TrackState.TRACKING]
    running.send(lost)
    running.graph.spin_until(lambda: len(outlines(markers, lost)) == 2)
    assert outlines(markers, lost) == {1: None, 2: (32, 12, 8, 6)}
    assert {marker.ns for marker in markers} == {'lmsco_tracker'}
    running.graph.call(Trigger, 'lmsco_tracker/reset')
    running.send(dropped)
    running.graph.spin_until(lambda: outlines(markers, dropped))
    assert outlines(markers, dropped) == {2: None}


def test_target_that_catches_up_leaves_the_markers_of_the_others(several):
    running = several()
    markers = running.graph.listen(ImageMarker, 'lmsco_tracker/marker')
    first, second = (running.graph.image() for _ in range(2))
    running.send(first, second)
    stamp = first.header.stamp
    running.start_stamped((50, 12, 8, 6), stamp.sec * 10 ** 9 + stamp.nanosec)
    running.graph.spin_until(lambda: 3 in outlines(markers, second))
    assert not [marker for marker in markers if box_from_marker(marker) is None]


def test_detections_hold_all_targets(several, monkeypatch):
    detections = []
    listener = Mock(publish=detections.append, get_subscription_count=lambda: 1)
    monkeypatch.setattr('lmsco_ros.node.outputs.Outputs._detections_publisher',
                        lambda self, made: listener)
    monkeypatch.setattr('lmsco_ros.node.outputs.detections_from_boxes',
                        lambda boxes, header: list(boxes))
    running = several()
    running.send()
    running.graph.spin_until(lambda: detections and len(detections[-1]) == 2)
    assert [(found.track_id, found.box[0]) for found in detections[-1]] == [('1', 11), ('2', 31)]
