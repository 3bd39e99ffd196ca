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

"""The members of a storm over a node: clients that ask for anything, and a camera."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
import random
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image, RegionOfInterest
from std_srvs.srv import SetBool, Trigger

from lmsco_ros.synthetic import render_scene, SceneConfig
from msg_adapters.image import message_from_image
from msg_adapters.status import diagnoses_from_message, status_from_message

NODE_NAME = 'lmsco_tracker'
TRANSITIONS = (
    *(Transition(id=number) for number in (0, 1, 1, 2, 3, 3, 4, 8, 9, 10, 50, 60, 99, 255)),
    *(Transition(label=label) for label in (
        'configure', 'activate', 'deactivate', 'cleanup', 'create', 'destroy', 'bogus',
        'transition_success', 'transition_error', ' ')))
PARAMETERS = ('overlay_label', 'overlay_interval', 'no_image_timeout', 'frame_policy',
              'queue_size', 'image_reliability', 'frame_history_megabytes', 'use_sim_time',
              'autostart', 'unheard_of', '')
_TYPES = (*range(10), 10, 77, 255)
_WORDS = ('', 'x' * 5000, 'all', 'latest', 'reliable', 'best_effort', 'default')
# Offered while the node is configured: a request that meets its end is never answered.
TAKEN_AWAY = ('resets', 'pauses')
_TAKEN_AWAY_SECONDS = 1.0
PATIENCE_SECONDS = 20.0
# A service that is not offered now is waited for so long.
_PAUSE_SECONDS = 0.01
# The frame history has filled by then.
_SETTLING_IMAGES = 150
# Of all images.
_SPOILED = 0.05


@dataclass
class Counts:
    """What became of the requests of one kind."""

    sent: int = 0
    answered: int = 0
    refused: int = 0

    @property
    def lost(self) -> int:
        """Those that were never answered."""
        return self.sent - self.answered


class Member:
    """
    One node of the storm, with a context of its own.

    Parameters
    ----------
    name : str
        Of the node.
    namespace : str
        Of the node under test, too.

    """

    def __init__(self, name: str, namespace: str) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node(name, context=self.context, namespace=namespace)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)

    def client(self, kind: Any, name: str) -> Client:
        """Return a client of a service of the node under test."""
        return self.node.create_client(kind, f'{NODE_NAME}/{name}')

    def ask(self, client: Client, request: Any, seconds: float = PATIENCE_SECONDS) -> Any:
        """Return the answer, or None when there is none in time."""
        future = client.call_async(request)
        if not self.spin(future.done, seconds):
            client.remove_pending_request(future)
            return None
        return future.result()

    def spin(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Let things happen until the condition holds; return whether it does in time."""
        deadline = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > deadline:
                return False
            self._executor.spin_once(timeout_sec=0.02)
        return True

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


class Troublemaker(Member):
    """
    Asks for one thing after the other.

    Parameters
    ----------
    name, namespace : str
        As for :class:`Member`.
    seed : int
        Of the choice.

    """

    def __init__(self, name: str, namespace: str, seed: int) -> None:
        super().__init__(name, namespace)
        self.requests: dict[str, Counts] = {}
        self.published: Counter = Counter()
        self._random = random.Random(seed)
        self._boxes = self.node.create_publisher(RegionOfInterest, 'init_box', 10)
        self._polygons = self.node.create_publisher(PolygonStamped, 'init_box_stamped', 10)
        self._services: list[tuple[str, Client, Callable[[], Any], Callable[[Any], bool]]] = [
            ('transitions', self.client(ChangeState, 'change_state'), self._transition,
             lambda answer: answer.success),
            ('parameters', self.client(SetParameters, 'set_parameters'),
             lambda: SetParameters.Request(parameters=self._parameters()),
             lambda answer: all(result.successful for result in answer.results)),
            ('parameters, together',
             self.client(SetParametersAtomically, 'set_parameters_atomically'),
             lambda: SetParametersAtomically.Request(parameters=self._parameters()),
             lambda answer: answer.result.successful),
            ('resets', self.client(Trigger, 'reset'), Trigger.Request,
             lambda answer: answer.success),
            ('pauses', self.client(SetBool, 'set_enabled'),
             lambda: SetBool.Request(data=self._random.random() < 0.5),
             lambda answer: answer.success),
        ]

    def make_trouble(self, until: float) -> None:
        """Go on until that time on the clock of `time.monotonic`."""
        while time.monotonic() < until:
            if self._random.random() < 0.2:
                self._start()
            else:
                self._request(*self._random.choice(self._services))

    def _request(self, name: str, client: Client, make: Callable[[], Any],
                 is_granted: Callable[[Any], bool]) -> None:
        # While the node is not configured some are not offered.
        if not client.service_is_ready():
            self.spin(client.service_is_ready, _PAUSE_SECONDS)
            return
        counts = self.requests.setdefault(name, Counts())
        counts.sent += 1
        answer = self.ask(client, make(), _TAKEN_AWAY_SECONDS if name in TAKEN_AWAY
                          else PATIENCE_SECONDS)
        if answer is not None:
            counts.answered += 1
            counts.refused += not is_granted(answer)

    def _transition(self) -> ChangeState.Request:
        return ChangeState.Request(transition=self._random.choice(TRANSITIONS))

    def _parameters(self) -> list[Parameter]:
        choose = self._random.choice
        return [Parameter(name=choose(PARAMETERS), value=ParameterValue(
            type=choose(_TYPES), bool_value=choose((True, False)),
            integer_value=choose((0, 1, 30, -1, 2 ** 63 - 1)),
            double_value=choose((0.0, 3.0, -1.0, float('nan'), float('inf'))),
            string_value=choose(_WORDS))) for _ in range(self._random.randrange(1, 4))]

    def _start(self) -> None:
        draw = self._random.randrange
        if self._random.random() < 0.5:
            self._boxes.publish(RegionOfInterest(
                x_offset=draw(400), y_offset=draw(300), width=draw(0, 60), height=draw(0, 60)))
        else:
            points = [Point32(x=float(draw(-50, 400)), y=self._random.choice(
                (float(draw(300)), float('nan')))) for _ in range(draw(0, 6))]
            message = PolygonStamped(polygon=Polygon(points=points))
            message.header.stamp = self.node.get_clock().now().to_msg()
            message.header.stamp.sec -= draw(0, 4)
            self._polygons.publish(message)
        self.published['starts'] += 1


class Camera(Member):
    """
    Sends images, good ones and some that are not, and hears what the node says.

    Parameters
    ----------
    namespace : str
        As for :class:`Member`.
    rate : float
        Images per second.
    seed : int
        Of the choice.

    """

    def __init__(self, namespace: str, rate: float, seed: int) -> None:
        super().__init__('camera', namespace)
        self.published: Counter = Counter()
        self.answered = 0
        self.faults = -1
        self._random = random.Random(seed)
        self._image = message_from_image(next(iter(render_scene(
            SceneConfig(320, 256, frames=1)))).image)
        self._images = self.node.create_publisher(Image, 'image_raw', 10)
        self.node.create_subscription(DiagnosticArray, f'{NODE_NAME}/status', self._on_status, 10)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_health, 10)
        self._timer = self.node.create_timer(1 / rate, self._send)
        self._change = self.client(ChangeState, 'change_state')
        self._state = self.client(GetState, 'get_state')

    def wait_for_node(self) -> bool:
        """Wait until the node answers images."""
        return self.spin(lambda: self.answered > 0, 3 * PATIENCE_SECONDS)

    def activate_node(self) -> None:
        """Bring the node to life, and let it answer images for a moment."""
        steps = {State.PRIMARY_STATE_UNCONFIGURED: Transition.TRANSITION_CONFIGURE,
                 State.PRIMARY_STATE_INACTIVE: Transition.TRANSITION_ACTIVATE}
        for _ in range(4):
            answer = self.ask(self._state, GetState.Request())
            step = None if answer is None else steps.get(answer.current_state.id)
            if step is None:
                break
            self.ask(self._change, ChangeState.Request(transition=Transition(id=step)))
        settled = self.answered + _SETTLING_IMAGES
        self.spin(lambda: self.answered > settled, PATIENCE_SECONDS)

    def answers(self) -> bool:
        """Tell whether the node answers an image now."""
        before = self.answered
        return self.spin(lambda: self.answered > before, PATIENCE_SECONDS)

    def told_faults(self) -> int:
        """Return the counter of the next health report; -1 when there is none."""
        self.faults = -1
        self.spin(lambda: self.faults >= 0, PATIENCE_SECONDS)
        return self.faults

    def _send(self) -> None:
        self._image.header.stamp = self.node.get_clock().now().to_msg()
        spoiled = self._random.random() < _SPOILED
        self._image.encoding = self._random.choice(('', 'bogus', '32FC1')) if spoiled \
            else 'mono16'
        self._images.publish(self._image)
        self.published['images'] += 1

    def _on_status(self, message: DiagnosticArray) -> None:
        self.answered += status_from_message(message).state != 'refused'

    def _on_health(self, message: DiagnosticArray) -> None:
        for diagnosis in diagnoses_from_message(message):
            if diagnosis.name == NODE_NAME:
                self.faults = int(diagnosis.values['faults'])
