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


"""A ROS graph of one test's own, and trackers that do as they are told."""

from collections.abc import Callable
import functools
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image, RegionOfInterest

from lmsco_ros.core.types import BoundingBox, TrackResult, TrackState
from lmsco_ros.node.tracker_node import TrackerNode
from msg_adapters.boxes import box_from_polygon, polygon_from_box
from msg_adapters.image import message_from_image
from msg_adapters.status import status_from_message

# Generous for a machine under load, and longer than the 20 s after which the middleware forgets a
# participant that was killed.
PATIENCE = 100.0


class FakeTracker:
    """
    Moves every box one pixel to the right in every frame.

    `states` overrides the state of coming updates, target by target, `error` is raised once,
    `inspect` may raise whatever it thinks of an image, `gate` holds every call until it is set,
    `calls` tells what happened on which image.
    """

    def __init__(self):
        self.states, self.error, self.calls, self.times = [], None, [], []
        self.results, self._started = {}, 0
        self.inspect = lambda image: None
        self.gate = threading.Event()
        self.gate.set()

    def initialize(self, image, box, time, in_place_of=()):
        self.calls.append(('initialize', image.copy()))
        self.times.append(time)
        self._obey(image)
        for number in in_place_of:
            self.drop(number)
        self._started += 1
        self.results[self._started] = self._result(box, TrackState.TRACKING)
        return self._started

    def initialize_at(self, image, point, time, in_place_of=()):
        return self.initialize(image, BoundingBox.from_center(point, (8, 6)), time, in_place_of)

    def update(self, image, time, only=None):
        self.calls.append(('update', image.copy()))
        self.times.append(time)
        self._obey(image)
        moved = {}
        for number in self.results if only is None else only:
            box = self.results[number].box
            moved[number] = self._result(
                BoundingBox(box.x + 1, *box.as_tuple()[1:]),
                self.states.pop(0) if self.states else TrackState.TRACKING)
        self.results.update(moved)
        return moved

    def learn(self):
        pass

    def drop(self, number):
        del self.results[number]

    def reset(self):
        self.results.clear()

    def _obey(self, image):
        assert self.gate.wait(PATIENCE)
        self.inspect(image)
        error, self.error = self.error, None
        if error is not None:
            raise error

    def _result(self, box, state):
        return TrackResult(
            box, 0.75, state, np.full((4, 4), 0.5, np.float32), box, velocity=(30.0, -15.0),
            covariance=np.diag([1.0, 4.0, 9.0, 16.0]),
            predicted_box=BoundingBox(box.x + 2, box.y + 1, *box.size),
            velocity_covariance=np.array([[25.0, 5.0], [5.0, 36.0]]))


class Graph:
    """One context with one executor and a node that plays camera and user."""

    def __init__(self, namespace='/'):
        self.context = Context()
        self.context.init()
        self.executor = SingleThreadedExecutor(context=self.context)
        self.namespace = namespace
        self.user = Node('user', context=self.context, namespace=namespace)
        self.executor.add_node(self.user)
        self.fake = FakeTracker()
        self.received = {}
        self.trackers = []
        self._clients = {}
        self._stamp = 0

    def start_tracker(self, **values) -> TrackerNode:
        """Start the node under test with the fake tracker unless another is given."""
        factory = values.pop('tracker_factory', lambda settings: self.fake)
        node = TrackerNode(
            context=self.context, namespace=self.namespace, tracker_factory=factory,
            cli_args=values.pop('cli_args', None),
            parameter_overrides=[Parameter(name, value=value) for name, value in values.items()])
        self.executor.add_node(node)
        self.trackers.append(node)
        return node

    def publisher(self, kind, topic, qos=10, *, connected=True):
        """Make a publisher, and wait until somebody listens."""
        publisher = self.user.create_publisher(kind, topic, qos)
        if connected:
            self.spin_until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def listen(self, kind, topic, *, connected=True) -> list:
        """Return the list that messages on a topic will arrive in."""
        messages = self.received.setdefault(topic, [])
        subscription = self.user.create_subscription(kind, topic, messages.append, 100)
        if connected:
            self.spin_until(lambda: self.user.count_publishers(topic) > 0)
            for node in self.trackers:
                self.spin_until(lambda: all(
                    p.get_subscription_count() > 0 for p in node.publishers
                    if p.topic_name == subscription.topic_name))
        return messages

    def call(self, kind, name, **fields):
        """Call a service and return its answer."""
        if (kind, name) not in self._clients:
            self._clients[kind, name] = self.user.create_client(kind, name)
        client = self._clients[kind, name]
        self.spin_until(client.service_is_ready)
        future = client.call_async(kind.Request(**fields))
        self.spin_until(future.done)
        return future.result()

    def settle(self) -> None:
        """Wait until the nodes have heard everything that was published so far."""
        for node in self.trackers:
            self.call(GetParameters, f'{node.get_fully_qualified_name()}/get_parameters',
                      names=['preset'])

    def spin_until(self, condition: Callable[[], bool]) -> None:
        """Let things happen until the condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, 'nothing happened in time'
            self.executor.spin_once(timeout_sec=0.02)

    def answer(self, messages: list, image, since=0):
        """Wait for the message with the header of an image, and return it."""
        def found():
            return [message for message in messages[since:] if message.header == image.header]
        self.spin_until(found)
        return found()[0]

    def image(self, value=0, *, stamp=None, shape=(48, 64), dtype=np.uint16) -> Image:
        """Return an image message with the next stamp."""
        self._stamp = self._stamp + 33_000_000 if stamp is None else stamp
        message = message_from_image(np.full(shape, value, dtype))
        message.header.frame_id = 'thermal'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self._stamp, 10 ** 9)
        return message

    def close(self) -> None:
        """Take everything down."""
        self.fake.gate.set()
        for node in [*self.trackers, self.user]:
            node.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()


@pytest.fixture
def graph():
    """Return a graph of its own for each test."""
    graph = Graph()
    yield graph
    graph.close()


@pytest.fixture
def own_graph(request):
    """
    Return a graph with names that no other test uses.

    The middleware believes in the subscriptions of a killed process for a while.
    """
    graph = Graph(f'/{request.node.name}')
    yield graph
    graph.close()


@pytest.fixture
def other_graph():
    """Return a second graph, of somebody else."""
    graph = Graph()
    yield graph
    graph.close()


class Running:
    """A running tracker node with its most used topics connected."""

    def __init__(self, graph, camera=(Image, 'image_raw'), **values):
        self.graph, self.fake = graph, graph.fake
        self.node = graph.start_tracker(**values)
        self.images = graph.publisher(*camera)
        self.init_box = graph.publisher(RegionOfInterest, 'init_box')
        self.init_box_stamped = graph.publisher(PolygonStamped, 'init_box_stamped')
        self.boxes = graph.listen(PolygonStamped, 'lmsco_tracker/box')
        self._status_messages = graph.listen(DiagnosticArray, 'lmsco_tracker/status')

    @property
    def statuses(self):
        """Everything that was said on ~/status."""
        return [status_from_message(message) for message in self._status_messages]

    @property
    def status_headers(self):
        """Headers of everything that was said on ~/status."""
        return [message.header for message in self._status_messages]

    def send(self, *images):
        """Publish images one by one, wait for the answer to each, and return the last status."""
        for image in images or [self.graph.image()]:
            told, boxes = len(self._status_messages), len(self.boxes)
            self.images.publish(image)
            status = status_from_message(
                self.graph.answer(self._status_messages, image, told))
            if status.state in ('tracking', 'uncertain'):
                self.graph.answer(self.boxes, image, boxes)
        return status

    def start(self, x=10, y=12, width=8, height=6):
        """Publish a box to start on, and wait until it has arrived."""
        self.init_box.publish(RegionOfInterest(x_offset=x, y_offset=y, width=width,
                                               height=height))
        self.settle()

    def start_stamped(self, box, stamp):
        """Publish a box with a stamp, and wait until it has arrived."""
        message = polygon_from_box(box)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10 ** 9)
        self.init_box_stamped.publish(message)
        self.settle()

    def settle(self):
        """Wait until everything that was published so far has been heard by the node."""
        self.graph.settle()

    @property
    def last_box(self):
        """The newest box as x, y, width, height."""
        return box_from_polygon(self.boxes[-1])


@pytest.fixture
def make_fake():
    """Return the maker of trackers that do as they are told."""
    return FakeTracker


@pytest.fixture
def running(graph):
    """Return a running tracker node with its most used topics connected."""
    return Running(graph)


@pytest.fixture
def run(graph):
    """Return a function that starts a node with parameters and, if need be, another camera."""
    return functools.partial(Running, graph)
