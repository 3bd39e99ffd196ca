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

"""What a node hears costs one request at most: it answers no, tells why, and goes on."""

from functools import partial
import math
import re
import threading

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_msgs.msg import Image
from std_srvs.srv import SetBool, Trigger

from lmsco_ros.node.tracker_node import TrackerNode
from msg_adapters.status import diagnoses_from_message

PATHS = {
    State.PRIMARY_STATE_UNCONFIGURED: (),
    State.PRIMARY_STATE_INACTIVE: ('configure',),
    State.PRIMARY_STATE_ACTIVE: ('configure', 'activate'),
    State.PRIMARY_STATE_FINALIZED: ('shutdown',),
}
POSSIBLE = {
    State.PRIMARY_STATE_UNCONFIGURED: {1: 'configure', 5: 'shutdown'},
    State.PRIMARY_STATE_INACTIVE: {2: 'cleanup', 3: 'activate', 6: 'shutdown'},
    State.PRIMARY_STATE_ACTIVE: {4: 'deactivate', 7: 'shutdown'},
    State.PRIMARY_STATE_FINALIZED: {},
}
NUMBERS = [*range(12), 50, 60, 61, 97, 98, 99, 255]
LABELS = ['configure', 'cleanup', 'activate', 'deactivate', 'shutdown', 'create', 'destroy',
          'transition_success', 'transition_failure', 'transition_error', 'bogus', 'ACTIVATE',
          ' ', 'ä' * 5000]


def change(graph, **transition):
    request = Transition(**transition)
    return graph.call(ChangeState, 'lmsco_tracker/change_state', transition=request).success


def state(graph):
    return graph.call(GetState, 'lmsco_tracker/get_state').current_state.id


def last_error(node):
    return node._monitor.report('', problem=None, dropped_frames=0).values['last_error']


def faults(node):
    return int(node._monitor.report('', problem=None, dropped_frames=0).values['faults'])


def raising(error):
    """Return a function that raises whatever it is called with."""
    def work(*args, **kwargs):
        raise error
    return work


@pytest.mark.parametrize('start', PATHS)
def test_transitions_that_are_not_possible_are_refused_in_every_state(graph, start):
    node = graph.start_tracker(autostart=False)
    for label in PATHS[start]:
        assert change(graph, label=label)
    for number in NUMBERS:
        if number not in POSSIBLE[start]:
            assert not change(graph, id=number), number
            assert f'number {number} is not possible' in last_error(node)
    for label in LABELS:
        if label not in POSSIBLE[start].values():
            for number in (0, 3, 99):
                assert not change(graph, id=number, label=label), (number, label)
            assert label in last_error(node)
    assert state(graph) == start and faults(node) == 0
    expected = POSSIBLE[start].values() or ['none']
    assert all(word in last_error(node) for word in expected)


def test_label_counts_more_than_the_number(graph):
    graph.start_tracker(autostart=False)
    assert change(graph, id=99, label='configure')
    assert state(graph) == State.PRIMARY_STATE_INACTIVE


def parameter(name, kind, **value):
    return Parameter(name=name, value=ParameterValue(type=kind, **value))


@pytest.mark.parametrize('kind', [10, 77, 255])
def test_parameters_of_an_unknown_type_are_refused_one_by_one(graph, kind):
    node = graph.start_tracker()
    text = partial(parameter, 'overlay_label', ParameterType.PARAMETER_STRING)
    answer = graph.call(SetParameters, 'lmsco_tracker/set_parameters', parameters=[
        text(string_value='before'), parameter('preset', kind),
        parameter('no_image_timeout', ParameterType.PARAMETER_DOUBLE, double_value=9.0)])
    assert [result.successful for result in answer.results] == [True, False, True]
    assert f'preset: {kind} is no type' in answer.results[1].reason
    assert (node.settings.overlay_label, node.settings.no_image_timeout) == ('before', 9.0)
    result = graph.call(SetParametersAtomically, 'lmsco_tracker/set_parameters_atomically',
                        parameters=[text(string_value='after'), parameter('x', kind)]).result
    assert not result.successful and f'x: {kind}' in result.reason
    assert node.settings.overlay_label == 'before'


@pytest.mark.parametrize('wrong', [
    parameter('', ParameterType.PARAMETER_STRING, string_value='x'),
    parameter('unheard_of', ParameterType.PARAMETER_STRING, string_value='x'),
    parameter('overlay_label', ParameterType.PARAMETER_NOT_SET),
    parameter('overlay_label', ParameterType.PARAMETER_BYTE_ARRAY, byte_array_value=[b'a']),
    parameter('use_sim_time', ParameterType.PARAMETER_STRING, string_value='yes'),
    parameter('no_image_timeout', ParameterType.PARAMETER_DOUBLE, double_value=math.nan),
    parameter('overlay_interval', ParameterType.PARAMETER_INTEGER, integer_value=-2 ** 63),
], ids=lambda wrong: f'{wrong.name}-{wrong.value.type}')
def test_wrong_parameters_are_refused_with_a_reason(graph, wrong):
    graph.start_tracker()
    result, = graph.call(SetParameters, 'lmsco_tracker/set_parameters',
                         parameters=[wrong]).results
    assert not result.successful and result.reason
    result = graph.call(SetParametersAtomically, 'lmsco_tracker/set_parameters_atomically',
                        parameters=[wrong]).result
    assert not result.successful and result.reason


@pytest.mark.parametrize('name, words', [
    ('overlay_lable', 'overlay_lable is unknown.*did you mean overlay_label'),
    ('x' * 10 ** 5, 'x is unknown.*config/tracker.yaml lists all'),
    ('radiometrisch/größe', 'größe is unknown')], ids=['near', 'long', 'strange'])
def test_unknown_parameter_is_named_with_the_nearest(graph, name, words):
    graph.start_tracker()
    wrong = parameter(name, ParameterType.PARAMETER_STRING, string_value='x')
    result, = graph.call(SetParameters, 'lmsco_tracker/set_parameters',
                         parameters=[wrong]).results
    assert not result.successful and re.search(words, result.reason)
    result = graph.call(SetParametersAtomically, 'lmsco_tracker/set_parameters_atomically',
                        parameters=[wrong]).result
    assert not result.successful and re.search(words, result.reason)


@pytest.mark.parametrize('kind, name, method', [
    (Trigger, 'reset', 'reset'), (SetBool, 'set_enabled', 'set_enabled')])
def test_service_whose_work_raises_says_so(running, monkeypatch, capfd, kind, name, method):
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    worker = running.node._session.worker
    monkeypatch.setattr(worker, method, raising(MemoryError('no room')))
    for _ in range(2):
        answer = running.graph.call(kind, f'lmsco_tracker/{name}')
        assert not answer.success and 'MemoryError: no room' in answer.message
    monkeypatch.undo()
    assert running.graph.call(kind, f'lmsco_tracker/{name}').success
    before = len(health)
    # The next report may be on its way since before the faults.
    running.graph.spin_until(lambda: len(health) > before + 1)
    values = diagnoses_from_message(health[-1])[0].values
    assert values['faults'] == '2' and 'MemoryError' in values['last_error']
    assert capfd.readouterr().err.count('no room') == 1


def test_parameter_service_whose_work_raises_refuses(running, monkeypatch):
    monkeypatch.setattr('lmsco_ros.node.parameters.judge_change', raising(RuntimeError('oh')))
    wanted = parameter('overlay_label', ParameterType.PARAMETER_STRING, string_value='x')
    for result in (
            running.graph.call(SetParameters, 'lmsco_tracker/set_parameters',
                               parameters=[wanted]).results[0],
            running.graph.call(SetParametersAtomically, 'lmsco_tracker/set_parameters_atomically',
                               parameters=[wanted]).result):
        assert not result.successful and 'RuntimeError: oh' in result.reason
    assert running.node.settings.overlay_label == ''


def test_services_that_rclpy_brings_along_are_guarded(running, monkeypatch):
    monkeypatch.setattr(running.node, 'get_parameter', raising(MemoryError()))
    answer = running.graph.call(GetParameters, 'lmsco_tracker/get_parameters', names=['preset'])
    assert not answer.values and faults(running.node) == 1
    assert all(hasattr(service.callback, '__wrapped__') for service in running.node.services)


def test_message_whose_callback_raises_costs_that_message(running, monkeypatch, capfd):
    running.start()
    running.send()
    monkeypatch.setattr(running.node._monitor, 'received', raising(RuntimeError('odd')))
    for _ in range(3):
        running.images.publish(running.graph.image())
    running.graph.spin_until(lambda: faults(running.node) == 3)
    monkeypatch.undo()
    assert running.send().state == 'tracking'
    errors = capfd.readouterr().err
    assert errors.count('RuntimeError: odd') == 1 and '/image_raw' in errors


def test_timer_whose_work_raises_comes_again(running, monkeypatch):
    monkeypatch.setattr(running.node._monitor, 'report', raising(MemoryError()))
    running.graph.spin_until(lambda: running.node._monitor._counts['faults'])
    monkeypatch.undo()
    health = running.graph.listen(DiagnosticArray, '/diagnostics')
    running.graph.spin_until(lambda: health)
    assert 'a timer' in last_error(running.node)


@pytest.mark.parametrize('error, state_after', [
    (MemoryError('no room'), State.PRIMARY_STATE_UNCONFIGURED),
    (SystemError('odd'), State.PRIMARY_STATE_UNCONFIGURED)])
def test_transition_that_raises_is_told_and_can_be_tried_again(graph, error, state_after):
    failing = [error]

    def factory(settings):
        if failing:
            raise failing.pop()
        return graph.fake
    node = graph.start_tracker(autostart=False, tracker_factory=factory)
    assert not change(graph, label='configure')
    assert state(graph) == state_after
    assert str(error) in last_error(node) and faults(node) == 1
    assert change(graph, label='configure') and change(graph, label='activate')


@pytest.mark.parametrize('label, left_in', [
    ('configure', State.PRIMARY_STATE_UNCONFIGURED),
    ('transition_success', State.PRIMARY_STATE_INACTIVE),
    ('transition_error', State.PRIMARY_STATE_UNCONFIGURED)])
def test_transition_that_breaks_off_inside_of_rclpy_leaves_a_usable_node(graph, label, left_in):
    """As it does when there is no memory to announce the new state."""
    node = graph.start_tracker(autostart=False)
    if label == 'transition_error':
        node._tracker_factory = raising(OSError('no weights'))
    node._state_machine = BreaksOff(node._state_machine, label)
    assert not change(graph, label='configure')
    assert state(graph) == left_in and 'announce' in last_error(node)
    node._tracker_factory = lambda settings: graph.fake
    if left_in == State.PRIMARY_STATE_UNCONFIGURED:
        assert change(graph, label='configure')
    assert change(graph, label='activate') and node.is_active


class BreaksOff:
    """A state machine that fails once, after the named transition has been made."""

    def __init__(self, machine, label):
        self._machine, self._label = machine, label

    def __getattr__(self, name):
        return getattr(self._machine, name)

    def trigger_transition_by_id(self, number, publish):
        self._machine.trigger_transition_by_id(number, publish)
        self._break('configure')

    def trigger_transition_by_label(self, label, publish):
        self._machine.trigger_transition_by_label(label, publish)
        self._break(label)

    def _break(self, label):
        if label == self._label:
            self._label = None
            raise RuntimeError('cannot announce the state')


@pytest.mark.parametrize('name', ['image_raw', 'init_box_stamped', '~/overlay', '~/set_enabled'])
def test_name_that_cannot_be_used_is_refused_and_nothing_stays_behind(graph, capfd, name):
    graph.start_tracker(autostart=False)
    node = TrackerNode(context=graph.context, tracker_factory=lambda settings: graph.fake,
                       cli_args=['--ros-args', '-r', f'{name}:=/{"a" * 300}'])
    graph.trackers.append(node)
    errors = capfd.readouterr().err
    assert not node.is_active and errors.count(f'{name} cannot be offered') == 1
    assert 'Traceback' not in errors and not list(node.subscriptions)
    if node._tracker is not None:
        assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert all('reset' not in service.srv_name for service in node.services)
    assert all('box' not in publisher.topic_name for publisher in node.publishers)


def test_activation_that_fails_late_leaves_nothing_behind(graph, monkeypatch):
    node = graph.start_tracker(autostart=False)
    node.trigger_configure()
    create = node.create_subscription

    def fail_late(kind, topic, *args, **kwargs):
        if topic == 'init_box_stamped':
            raise MemoryError()
        return create(kind, topic, *args, **kwargs)
    monkeypatch.setattr(node, 'create_subscription', fail_late)
    assert not change(graph, label='activate')
    assert not list(node.subscriptions)
    assert 'tracker' not in [thread.name for thread in threading.enumerate()]
    monkeypatch.undo()
    assert change(graph, label='configure') and change(graph, label='activate')
    images = graph.publisher(Image, 'image_raw')
    statuses = graph.listen(DiagnosticArray, 'lmsco_tracker/status')
    images.publish(graph.image())
    graph.spin_until(lambda: statuses)
