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

"""The executor of the process: what rclpy itself raises costs one message."""

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from lmsco_ros.node.executor import GuardedExecutor


@pytest.fixture
def noted():
    """Return the list of everything that is noted."""
    return []


@pytest.fixture
def guarded(graph, noted):
    """Return the graph, with an executor that notes what is raised in place of its own."""
    graph.executor.shutdown()
    graph.executor = GuardedExecutor(lambda *note: noted.append(note), context=graph.context)
    graph.executor.add_node(graph.user)
    return graph


def fail_once(monkeypatch, owner, method, error):
    """Let a method raise once, and work afterwards."""
    original, failing = getattr(owner, method), [error]

    def work(*args, **kwargs):
        if failing:
            raise failing.pop()
        return original(*args, **kwargs)
    monkeypatch.setattr(owner, method, work)


@pytest.mark.parametrize('error', [MemoryError('bad_alloc'), RuntimeError('failed to take')])
def test_image_that_cannot_be_taken_costs_that_image(guarded, noted, monkeypatch, error):
    guarded.start_tracker()
    images = guarded.publisher(Image, 'image_raw')
    heard = guarded.listen(type(String()), 'other', connected=False)
    others = guarded.user.create_publisher(String, 'other', 10)
    fail_once(monkeypatch, guarded.executor, '_take_subscription', error)
    images.publish(guarded.image())
    guarded.spin_until(lambda: noted)
    assert noted == [('what came in on /image_raw', error)]
    before = guarded.trackers[0]._monitor._counts['received']
    images.publish(guarded.image())
    guarded.spin_until(lambda: guarded.trackers[0]._monitor._counts['received'] == before + 1)
    others.publish(String(data='x'))
    guarded.spin_until(lambda: heard)


def test_request_that_cannot_be_taken_costs_that_request(guarded, noted, monkeypatch):
    guarded.start_tracker()
    client = guarded.user.create_client(Trigger, 'lmsco_tracker/reset')
    guarded.spin_until(client.service_is_ready)
    fail_once(monkeypatch, guarded.executor, '_take_service', MemoryError())
    client.call_async(Trigger.Request())
    guarded.spin_until(lambda: noted)
    assert guarded.call(Trigger, 'lmsco_tracker/reset').success
    # The others of the same callback group are not blocked.
    assert guarded.call(GetParameters, 'lmsco_tracker/get_parameters', names=['preset']).values


def test_timer_that_cannot_be_taken_comes_again(guarded, noted, monkeypatch):
    ticks = []
    fail_once(monkeypatch, guarded.executor, '_take_timer', RuntimeError('odd'))
    guarded.user.create_timer(0.01, lambda: ticks.append(None))
    guarded.spin_until(lambda: noted and ticks)


def test_answer_that_cannot_be_sent_costs_that_answer(guarded, noted, monkeypatch):
    node = guarded.start_tracker()
    service, = [each for each in node.services if each.srv_name.endswith('reset')]
    fail_once(monkeypatch, service, 'send_response', RuntimeError('nobody there'))
    client = guarded.user.create_client(Trigger, 'lmsco_tracker/reset')
    guarded.spin_until(client.service_is_ready)
    client.call_async(Trigger.Request())
    guarded.spin_until(lambda: noted)
    assert guarded.call(Trigger, 'lmsco_tracker/reset').success


def test_waiting_that_fails_is_tried_again(guarded, noted, monkeypatch):
    heard = guarded.listen(String, 'text', connected=False)
    others = guarded.user.create_publisher(String, 'text', 10)
    fail_once(monkeypatch, guarded.executor, 'get_nodes', MemoryError())
    guarded.spin_until(lambda: noted)
    others.publish(String(data='x'))
    guarded.spin_until(lambda: heard)
    assert noted[0][0] == 'work of the executor'


def test_end_of_the_context_is_no_fault(noted):
    context = Context()
    context.init()
    executor = GuardedExecutor(lambda *note: noted.append(note), context=context)
    context.shutdown()
    with pytest.raises(ExternalShutdownException):
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    assert not noted
