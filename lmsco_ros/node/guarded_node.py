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

"""A lifecycle node that no message, no request and no timer can end, in any executor."""

from __future__ import annotations

from collections.abc import Callable, Collection
import functools
from typing import Any

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.lifecycle import LifecycleNode, LifecycleState
from rclpy.lifecycle.publisher import LifecyclePublisher
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from lmsco_ros.core.errors import ConfigError
from lmsco_ros.node.faults import Faults
from lmsco_ros.node.service_answers import (Answer, refusal, set_each, set_together,
                                            transition_objection)

_TRANSITION_STATES = (
    State.TRANSITION_STATE_CONFIGURING, State.TRANSITION_STATE_CLEANINGUP,
    State.TRANSITION_STATE_SHUTTINGDOWN, State.TRANSITION_STATE_ACTIVATING,
    State.TRANSITION_STATE_DEACTIVATING)
_QUIET_SECONDS = 5.0


class GuardedNode(LifecycleNode):
    """
    Whatever is raised by the work on a request costs that request, and only that.

    A service answers ``success: false`` with the reason. Transitions that are not possible
    now, and parameters of an unknown type, are refused.

    Parameters
    ----------
    node_name : str
        Name, unless remapped.
    count_fault : callable
        Called with the text of everything that is raised without a remedy.
    count_refusal : callable
        Called with the reason of every transition that is refused.
    **kwargs
        As for `rclpy.lifecycle.LifecycleNode`.

    """

    def __init__(self, node_name: str, *, count_fault: Callable[[str], None],
                 count_refusal: Callable[[str], None], **kwargs: Any) -> None:
        self.faults = Faults(self.get_logger, count_fault, lambda: self.context.ok())
        self._count_refusal = count_refusal
        super().__init__(node_name, **kwargs)
        for service in self.services:
            # Those that rclpy makes without create_service.
            if not hasattr(service.callback, '__wrapped__'):
                service.callback = self._answering(
                    service.srv_type, service.srv_name, service.callback)

    def guarded(self, work: str, callback: Callable[..., object]) -> Callable[..., None]:
        """
        Return a callback that notes what the given one raises.

        Parameters
        ----------
        work : str
            What is given up then.
        callback : callable
            Its result is not used.

        """
        @functools.wraps(callback)
        def wrapper(*args: Any) -> None:
            try:
                callback(*args)
            except Exception as error:  # noqa: B902
                self.faults.note(work, error)
        return wrapper

    def create_subscription(self, msg_type: type, topic: str, callback: Callable[..., object],
                            *args: Any, **kwargs: Any) -> Subscription:
        """Subscribe, as `rclpy.node.Node.create_subscription` does; the callback is guarded."""
        guarded = self.guarded(f'a message on {self.resolve_topic_name(topic)}', callback)
        return super().create_subscription(msg_type, topic, guarded, *args, **kwargs)

    def create_lifecycle_publisher(self, msg_type: type, topic: str, *args: Any,
                                   **kwargs: Any) -> LifecyclePublisher:
        """Publish, as `rclpy.lifecycle.LifecycleNode.create_lifecycle_publisher` does."""
        self.resolve_topic_name(topic)
        return super().create_lifecycle_publisher(msg_type, topic, *args, **kwargs)

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """Return the full name of a topic; ConfigError when it cannot be used."""
        return _resolved(super().resolve_topic_name, topic, only_expand)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """Return the full name of a service; ConfigError when it cannot be used."""
        return _resolved(super().resolve_service_name, service, only_expand)

    def create_timer(self, timer_period_sec: float, callback: Callable[[], object],
                     *args: Any, **kwargs: Any) -> Timer:
        """Make a timer, as `rclpy.node.Node.create_timer` does; the callback is guarded."""
        guarded = self.guarded('the work of a timer', callback)
        return super().create_timer(timer_period_sec, guarded, *args, **kwargs)

    def create_service(self, srv_type: type, srv_name: str, callback: Answer,
                       **kwargs: Any) -> Service:
        """Offer a service, as `rclpy.node.Node.create_service` does; it always answers."""
        name = self.resolve_service_name(srv_name)
        answering = self._answering(srv_type, name, callback)
        return super().create_service(srv_type, srv_name, answering, **kwargs)

    def destroy_node(self) -> None:
        """Take the node away, with the services of its transitions, which rclpy forgets."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def _answering(self, kind: Any, name: str, callback: Answer) -> Answer:
        """Return the callback of a service so that it answers whatever is asked."""
        @functools.wraps(callback)
        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:  # noqa: B902
                return refusal(kind, request,
                               self.faults.note(f'a request to {name}', error))
        judges: dict[Any, Callable[[Answer], Answer]] = {
            ChangeState: self._change_if_possible,
            SetParameters: functools.partial(set_each, known=self._known_parameters),
            SetParametersAtomically: functools.partial(
                set_together, known=self._known_parameters)}
        return judges[kind](answer) if kind in judges else answer

    def _known_parameters(self) -> Collection[str]:
        return self.get_parameters_by_prefix('')

    def _change_if_possible(self, change: Answer) -> Answer:
        """Return the callback of change_state so that it refuses what is not possible now."""
        @functools.wraps(change)
        def answer(request: ChangeState.Request,
                   response: ChangeState.Response) -> ChangeState.Response:
            machine = self._state_machine
            transition: Transition = request.transition
            objection = transition_objection(
                transition, machine.current_state[1], machine.available_transitions)
            if objection:
                self._count_refusal(objection)
                self.get_logger().warning(objection, throttle_duration_sec=_QUIET_SECONDS)
                return ChangeState.Response(success=False)
            response = change(request, response)
            self._end_transition()
            return response
        return answer

    def _end_transition(self) -> None:
        """Bring a transition that broke off to its end, so that others are possible again."""
        machine = self._state_machine
        if machine.current_state[0] in _TRANSITION_STATES:
            machine.trigger_transition_by_label('transition_error', False)
        state_id, label = machine.current_state
        if state_id == State.TRANSITION_STATE_ERRORPROCESSING:
            result: Any = self.on_error(LifecycleState(label=label, state_id=state_id))
            machine.trigger_transition_by_label(result.to_label(), False)


def _resolved(resolve: Callable[..., str], name: str, only_expand: bool) -> str:
    """Return the full name, or say what is wrong with the remapping of a legal one."""
    try:
        return resolve(name, only_expand=only_expand)
    except _rclpy.RCLError as error:
        reason = str(error).partition(', at /')[0]
        raise ConfigError(f'{name} cannot be offered or listened to under the name that it is '
                          f'remapped to: {reason}; remap it to a shorter or legal name') from error
