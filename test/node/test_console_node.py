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

"""The node of the console beside the real tracker node, over real ROS messages."""

import json

from geometry_msgs.msg import PointStamped
import numpy as np
import pytest
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import Image
from std_msgs.msg import UInt32

from lmsco_ros.console.console_node import ConsoleNode
from lmsco_ros.core.types import TrackState


@pytest.fixture
def console(graph):
    """Return a maker of consoles in the graph of the test."""
    nodes = []

    def make(**values):
        node = ConsoleNode(
            context=graph.context, parameter_overrides=[
                Parameter(name, value=value) for name, value in values.items()])
        graph.executor.add_node(node)
        nodes.append(node)
        return node
    yield make
    for node in nodes:
        node.destroy_node()


@pytest.fixture
def watched(running, console):
    """Return a running tracker with a console that hears both it and the camera."""
    running.console = console()
    graph = running.graph
    graph.spin_until(lambda: running.images.get_subscription_count() == 2)
    # The test itself listens to the status, too.
    listeners = {'/lmsco_tracker/status': 2, '/lmsco_tracker/boxes': 1,
                 '/lmsco_tracker/state': 1, '/init_box_stamped': 1, '/select': 1}
    for publisher in (*running.node.publishers, *running.console.publishers):
        graph.spin_until(lambda: publisher.get_subscription_count()
                         >= listeners.get(publisher.topic_name, 0))
    return running


def shown(running, image):
    """Return what the console shows of an image that is sent until it has it."""
    feed = running.console._feed
    running.send(image)
    stamp = image.header.stamp.sec * 10 ** 9 + image.header.stamp.nanosec

    def newest():
        moment = feed.after(0)
        return moment is not None and moment.stamp == stamp
    running.graph.spin_until(newest)
    return feed.after(0)


def follow(running, box=(10, 12, 8, 6)):
    """Start on the frame that the console shows, and return it."""
    moment = shown(running, running.graph.image(7))
    starts = len([status for status in running.statuses if status.start])
    running.console.start(moment.stamp, box)
    running.graph.spin_until(
        lambda: len([status for status in running.statuses if status.start]) > starts)
    return moment


def test_image_and_state_belong_together(watched):
    moment = shown(watched, watched.graph.image(7))
    assert moment.statuses[0].state == 'idle' and (moment.image == 7).all()
    follow(watched)
    moment = shown(watched, watched.graph.image(9))
    assert (moment.image == 9).all() and moment.statuses[0].state == 'tracking'
    assert tuple(moment.boxes[1])[1:] == (12, 8, 6)


def test_start_is_on_the_frame_that_was_seen(watched):
    seen = shown(watched, watched.graph.image(21))
    for value in (22, 23):
        shown(watched, watched.graph.image(value))
    watched.console.start(seen.stamp, (10.5, 12.25, 8, 6))
    watched.graph.spin_until(lambda: any(status.start for status in watched.statuses))
    kind, image = next(call for call in watched.fake.calls if call[0] == 'initialize')
    assert (image == 21).all()
    # It has caught up with the two frames after it.
    assert watched.send().track_id == 1 and watched.last_box == (13.5, 12.25, 8, 6)
    (event,) = watched.console.desk.chronicle.since(0)
    assert (event.kind, event.track_id) == ('accepted', 1)


def test_start_on_a_frame_that_is_gone_is_refused_and_told(watched):
    shown(watched, watched.graph.image())
    watched.console.start(12345, (10, 12, 8, 6))
    desk = watched.console.desk
    watched.graph.spin_until(lambda: desk.chronicle.since(0))
    (event,) = desk.chronicle.since(0)
    assert event.kind == 'refused' and 'stamp' in event.text


def test_lost_and_found_are_shown(watched):
    follow(watched)
    watched.fake.states = [TrackState.TRACKING, TrackState.LOST, TrackState.TRACKING]
    told = [shown(watched, watched.graph.image()) for _ in range(3)]
    assert [moment.statuses[0].state for moment in told] == ['tracking', 'lost', 'tracking']
    assert [set(moment.boxes) for moment in told] == [{1}, set(), {1}]
    kinds = [event.kind for event in watched.console.desk.chronicle.since(0)]
    assert kinds == ['accepted', 'lost', 'found']


def test_states_are_shown_with_their_frame_also_while_lost(watched):
    follow(watched)
    watched.fake.states = [TrackState.TRACKING, TrackState.LOST]
    for _ in range(2):
        moment = shown(watched, watched.graph.image())
        (state,) = moment.states.values()
        # The fake expects the target two pixels to the right of its box and one below.
        expected = watched.fake.results[1].predicted_box.center
        assert state.track_id == 1 and state.velocity == (30, -15)
        assert state.center == pytest.approx(expected)
    assert moment.statuses[0].state == 'lost' and moment.boxes == {}


def test_point_and_selection_are_published(graph, console):
    node = console()
    points, numbers = graph.listen(PointStamped, 'init_point'), graph.listen(UInt32, 'select')
    for publisher in node.publishers:
        if publisher.topic_name in ('/init_point', '/select'):
            graph.spin_until(lambda: publisher.get_subscription_count() > 0)
    node.point(1234567890123456789, 5.5, 6.0)
    node.select(4)
    graph.spin_until(lambda: points and numbers)
    stamp = points[0].header.stamp
    assert (stamp.sec, stamp.nanosec) == (1234567890, 123456789)
    assert (points[0].point.x, points[0].point.y) == (5.5, 6.0) and numbers[0].data == 4


def test_services_are_called_and_answered(watched):
    follow(watched)
    answers = []
    console, graph = watched.console, watched.graph
    graph.spin_until(console._reset.service_is_ready)
    graph.spin_until(console._set_enabled.service_is_ready)
    console.reset(lambda done, text: answers.append((done, text)))
    graph.spin_until(lambda: answers)
    assert answers.pop() == (True, 'all targets are dropped')
    assert shown(watched, graph.image()).statuses[0].state == 'idle'
    console.enable(False, lambda done, text: answers.append((done, text)))
    graph.spin_until(lambda: answers)
    assert answers == [(True, 'disabled')]
    assert shown(watched, graph.image()).statuses[0].state == 'disabled'


def test_tracker_that_is_not_there_is_told(console):
    answers = []
    console(tracker='other').reset(lambda done, text: answers.append((done, text)))
    ((done, text),) = answers
    assert not done and '/other/reset' in text and 'running' in text


def test_map_is_listened_to_only_when_it_is_wanted(watched):
    graph, console = watched.graph, watched.console

    def listeners():
        return graph.user.count_subscribers('lmsco_tracker/confidence_map')
    follow(watched)
    assert listeners() == 0 and shown(watched, graph.image()).confidence is None
    for who in (one := object(), other := object()):
        console.want_map(who, True)
    graph.spin_until(lambda: listeners() == 1)
    publisher = next(p for p in watched.node.publishers if p.topic_name.endswith('_map'))
    graph.spin_until(lambda: publisher.get_subscription_count() == 1)
    assert shown(watched, graph.image()).confidence.shape == (48, 64)
    console.want_map(one, False)
    console.want_map(other, False)
    graph.spin_until(lambda: listeners() == 0)


def test_all_that_is_shown_is_recorded(running, console, tmp_path):
    running.console, answers = console(record_folder=str(tmp_path / 'bags')), []
    graph = running.graph
    running.console.record(True, lambda done, text: answers.append((done, text)))
    graph.spin_until(lambda: answers)
    assert answers[0][0] and str(tmp_path) in answers[0][1]
    listeners = {'/lmsco_tracker/status': 3, '/lmsco_tracker/boxes': 2, '/image_raw': 3,
                 '/lmsco_tracker/box': 2, '/lmsco_tracker/state': 2, '/init_box_stamped': 1}
    for publisher in (*running.node.publishers, *graph.user.publishers,
                      *running.console.publishers):
        graph.spin_until(lambda: publisher.get_subscription_count()
                         >= listeners.get(publisher.topic_name, 0))
    seen = follow(running)
    shown(running, graph.image(9))
    # Of each frame an image, a status, a box of each kind and a state, of the start a status more.
    graph.spin_until(lambda: running.console.desk.recorded() >= 11)
    running.console.record(False, lambda done, text: answers.append((done, text)))
    graph.spin_until(lambda: len(answers) == 2)
    assert answers[1] == (True, '11 messages were recorded')
    assert running.console.desk.recorded() is None
    (bag,) = (tmp_path / 'bags').iterdir()
    with AnyReader([bag]) as reader:
        topics = {connection.topic for connection, *_ in reader.messages()}
        images = [reader.deserialize(data, connection.msgtype)
                  for connection, _, data in reader.messages()
                  if connection.topic == '/image_raw']
    assert topics == {'/image_raw', *(f'/lmsco_tracker/{name}'
                                      for name in ('status', 'box', 'boxes', 'state'))}
    stamps = [image.header.stamp.sec * 10 ** 9 + image.header.stamp.nanosec for image in images]
    assert stamps[0] == seen.stamp and len(stamps) == 2


@pytest.mark.parametrize('folder, words', [('', 'record_folder'), ('/dev/null/bags', 'null')])
def test_recording_that_cannot_be_is_told(graph, console, folder, words):
    node, answers = console(record_folder=folder), []
    node.record(True, lambda done, text: answers.append((done, text)))
    graph.spin_until(lambda: answers)
    assert not answers[0][0] and words in answers[0][1]


def test_bad_messages_are_survived(watched):
    broken = watched.graph.image()
    broken.encoding = 'nonsense'
    watched.send(broken)
    assert shown(watched, watched.graph.image(3)).image[0, 0] == 3


def test_images_are_shown_without_a_tracker(graph, console):
    node = console()
    images = graph.publisher(Image, 'image_raw')
    images.publish(graph.image(5))
    graph.spin_until(lambda: node._feed.after(0))
    assert node._feed.after(0).statuses == ()
    assert node.desk.images.silence > 0 and node.desk.answers.silence is None


def test_log_tells_when_images_and_answers_begin_once(watched, monkeypatch):
    told = []
    monkeypatch.setattr(type(watched.console.get_logger()), 'info',
                        lambda self, text, **more: told.append(text))
    for value in (1, 2):
        shown(watched, watched.graph.image(value))
    assert told == ['images come, 64 x 48 pixels', 'lmsco_tracker answers']


def test_compressed_images_are_shown(graph, console):
    from msg_adapters.compressed import compressed_from_image
    node = console(image_transport='compressed')
    images = graph.publisher(type(compressed_from_image(np.zeros((4, 4), np.uint8))),
                             'image_raw/compressed')
    images.publish(compressed_from_image(np.full((48, 64), 900, np.uint16)))
    graph.spin_until(lambda: node._feed.after(0))
    assert (node._feed.after(0).image == 900).all()


def test_parameters_of_the_wrong_type_are_refused(console):
    with pytest.raises(ParameterException):
        console(port='eighty')


def test_state_of_a_real_frame_is_json(watched):
    from lmsco_ros.console import replies
    follow(watched)
    desk = watched.console.desk
    data = replies.frame(shown(watched, watched.graph.image(5)), b'', desk, [], None,
                         'next')
    state = json.loads(data[4:])
    assert state['targets'][0]['counts'] == {'minimum': 5, 'mean': 5, 'maximum': 5}
